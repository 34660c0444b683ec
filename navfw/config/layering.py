"""One document on top of another: values of the upper one replace those of the lower one."""

from __future__ import annotations

import copy
from collections.abc import Container
from types import MappingProxyType

from navfw.config.document import Data, KeyPath, Origin, YamlDocument

__all__ = ["layered"]


def layered(
    lower: YamlDocument, upper: YamlDocument, replaced: Container[str] = ()
) -> YamlDocument:
    """``upper`` on ``lower``: mappings are merged key by key, other values are replaced.

    The mappings at the top-level keys ``replaced`` are not merged but replaced. Each part keeps its
    origin.

    >>> from navfw.config.document import parse_yaml
    >>> lower, upper = parse_yaml("a: {x: 1, y: 2}"), parse_yaml("a: {y: 3}")
    >>> layered(lower, upper).data, layered(lower, upper, {"a"}).data
    ({'a': {'x': 1, 'y': 3}}, {'a': {'y': 3}})
    """
    origins = {path: _named(origin, lower) for path, origin in lower.origins.items()}
    data = copy.deepcopy(lower.data)
    _put(data, origins, upper, (), replaced)
    return YamlDocument(upper.file, data, MappingProxyType(origins))


def _put(
    node: Data,
    origins: dict[KeyPath, Origin],
    upper: YamlDocument,
    at: KeyPath,
    replaced: Container[str],
) -> None:
    """Write the part of ``upper`` at path ``at`` into the mapping ``node``, and its origins."""
    for key, value in upper.at(at).items() if at else upper.data.items():
        path = (*at, key)
        merged = not (len(path) == 1 and key in replaced)
        if merged and isinstance(value, dict) and isinstance(node.get(key), dict):
            origins[path] = _named(upper.origin_of(path), upper)
            _put(node[key], origins, upper, path, replaced)
            continue
        node[key] = copy.deepcopy(value)
        for known in [p for p in origins if p[: len(path)] == path]:
            del origins[known]
        below = {p: o for p, o in upper.origins.items() if p[: len(path)] == path}
        origins.update({p: _named(origin, upper) for p, origin in below.items()})


def _named(origin: Origin, document: YamlDocument) -> Origin:
    """``origin`` with the file of ``document`` where it names none."""
    return Origin(origin.file or document.file, origin.line, origin.option)
