"""One document on top of another: what the upper one says counts, the rest is the lower one's."""

from __future__ import annotations

import copy
from collections.abc import Container
from types import MappingProxyType

from navfw.config.document import Data, KeyPath, Origin, YamlDocument

__all__ = ["layered"]


def layered(lower: YamlDocument, upper: YamlDocument, whole: Container[str] = ()) -> YamlDocument:
    """``upper`` on ``lower``: mappings are joined key by key, all else is replaced.

    The top-level keys in ``whole`` are replaced whole. Each part keeps its origin.

    >>> from navfw.config.document import parse_yaml
    >>> lower, upper = parse_yaml("a: {x: 1, y: 2}"), parse_yaml("a: {y: 3}")
    >>> layered(lower, upper).data, layered(lower, upper, {"a"}).data
    ({'a': {'x': 1, 'y': 3}}, {'a': {'y': 3}})
    """
    origins = {path: _named(origin, lower) for path, origin in lower.origins.items()}
    data = copy.deepcopy(lower.data)
    _put(data, origins, upper, (), whole)
    return YamlDocument(upper.file, data, MappingProxyType(origins))


def _put(
    node: Data,
    origins: dict[KeyPath, Origin],
    upper: YamlDocument,
    at: KeyPath,
    whole: Container[str],
) -> None:
    """Write what ``upper`` says at ``at`` into the mapping ``node``."""
    for key, value in upper.at(at).items() if at else upper.data.items():
        path = (*at, key)
        deeper = not (len(path) == 1 and key in whole)
        if deeper and isinstance(value, dict) and isinstance(node.get(key), dict):
            origins[path] = _named(upper.origin_of(path), upper)
            _put(node[key], origins, upper, path, whole)
            continue
        node[key] = copy.deepcopy(value)
        for known in [p for p in origins if p[: len(path)] == path]:
            del origins[known]
        said = {p: o for p, o in upper.origins.items() if p[: len(path)] == path}
        origins.update({p: _named(origin, upper) for p, origin in said.items()})


def _named(origin: Origin, document: YamlDocument) -> Origin:
    """``origin`` with its file, which documents of one file leave out."""
    return Origin(origin.file or document.file, origin.line, origin.option)
