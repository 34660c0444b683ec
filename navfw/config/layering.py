"""One document on top of another: values of the upper one replace those of the lower one."""

from __future__ import annotations

import copy
from collections.abc import Callable, Container
from pathlib import Path
from types import MappingProxyType

from navfw.config.document import Data, KeyPath, Origin, YamlDocument, load_yaml
from navfw.config.lookup import find
from navfw.errors import ConfigError


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


def on_its_base(
    document: YamlDocument,
    path: Path,
    kind: str,
    replaced: Container[str] = (),
    load: Callable[[Path], YamlDocument] = load_yaml,
    above: tuple[Path, ...] = (),
) -> YamlDocument:
    """``document``, the file at ``path``, on top of the one that its key ``base`` names, and so on.

    ``kind`` is that of all files, ``load`` reads one; see ``layered`` for ``replaced``.

    Raises:
        ConfigError: a base cannot be read, or the file is based on itself.
        UnknownNameError: a base does not exist.

    """
    name = document.data.get("base")
    if not isinstance(name, str):
        return document
    seen = (*above, path.resolve())
    with document.locating(("base",)):
        file = find(kind, name, base=path.parent)
        if file.resolve() in seen:
            raise ConfigError(f"the {kind} is based on itself; name another one")
    base = on_its_base(load(file), file, kind, replaced, load, seen)
    return layered(base, document, replaced)


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
