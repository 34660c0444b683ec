"""Changes values of a document: single ones, as ``--set a.b=1``, or those of another document."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

from navfw.config.document import Origin, YamlDocument, load_yaml, parse_yaml
from navfw.config.input_file import real_path
from navfw.config.lookup import find
from navfw.config.yaml_text import Data, KeyPath, key_text
from navfw.errors import ConfigError, did_you_mean

Settings: TypeAlias = str | Sequence[str] | Mapping[str, object]
"""Overrides: texts such as ``"offis.layers=1"``, or a mapping such as ``{"offis.layers": 1}``."""


@dataclass(frozen=True)
class Override:
    """Sets the value at ``path`` to ``value``; ``text`` is the option's argument as typed."""

    path: KeyPath
    value: Data
    text: str

    @property
    def option(self) -> str:
        """The option as error messages show it."""
        return f"--set {self.text}"

    def under(self, prefix: KeyPath) -> Override:
        """Return the same override with ``prefix`` before its path."""
        return replace(self, path=(*prefix, *self.path))

    def error(self, message: str) -> ConfigError:
        """Make an error whose key is this override."""
        return ConfigError(message, key=self.option)


def override_texts(settings: Settings) -> tuple[str, ...]:
    """Convert overrides to arguments of ``--set``; the values of a mapping must be plain data.

    >>> override_texts({"offis.layers": 1, "mission.goals": ["lab"]})
    ('offis.layers=1', 'mission.goals=["lab"]')
    >>> override_texts("offis.layers=1")
    ('offis.layers=1',)

    Raises:
        ConfigError: a value is not plain data: neither number, text, boolean, None, list nor
            mapping, or a number that is not finite.

    """
    if isinstance(settings, str):
        return (settings,)
    if not isinstance(settings, Mapping):
        return tuple(str(text) for text in settings)
    return tuple(f"{key}={_value_text(key, value)}" for key, value in settings.items())


def _value_text(key: str, value: object) -> str:
    """A value as JSON, which is YAML as well; numpy's numbers and arrays count as plain data."""
    try:
        plain = value.tolist() if hasattr(value, "tolist") else value
        return json.dumps(plain, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError):
        what = "expected plain data: a finite number, text, boolean, None, list or mapping"
        raise ConfigError(f"{what}; got {value!r:.60}", key=f"set {key}") from None


def parse_override(text: str) -> Override:
    """Parse ``a.b=c``: keys separated by dots, ``=``, a YAML value.

    An item of a list is addressed by its index, counted from 0, or by its ``name``.

    >>> parse_override("rooms.0.size=[3, 4]").path
    ('rooms', 0, 'size')

    Raises:
        ConfigError: there is no ``=``, a key is empty, or the value is not YAML.

    """
    keys, equals, value = text.partition("=")
    steps = [step.strip() for step in keys.split(".")]
    if not equals or not all(steps):
        raise ConfigError("expected key=value with keys like a.b", key=f"--set {text}")
    try:
        data = parse_yaml(value).data
    except ConfigError as error:
        raise ConfigError(
            f"expected a YAML value after '=': {error}", key=f"--set {text}"
        ) from None
    return Override(tuple(_step(step) for step in steps), data, text)


def apply_overrides(document: YamlDocument, overrides: Sequence[str | Override]) -> YamlDocument:
    """Return a copy of ``document`` with the overrides applied in order.

    Raises:
        ConfigError: an override is malformed, its path leads through a value that is neither a
            mapping nor a list, or it names an item that a list does not have. Keys that the file
            does not have are added; validation rejects unknown ones.

    """
    if not overrides:
        return document
    data = copy.deepcopy(document.data)
    origins = dict(document.origins)
    for item in overrides:
        override = parse_override(item) if isinstance(item, str) else item
        path, created = _put(data, override)
        _forget(origins, path)
        for part in (path, *created):
            origins[part] = Origin(option=override.option)
    return YamlDocument(document.file, data, MappingProxyType(origins))


def _forget(origins: dict[KeyPath, Origin], path: KeyPath) -> None:
    """Remove the origins of the part at ``path`` and of all within it."""
    for inner in [p for p in origins if p[: len(path)] == path]:
        del origins[inner]


def _step(text: str) -> str | int:
    if text.isascii() and text.isdigit() and len(text) < 9 and str(int(text)) == text:
        return int(text)
    return text


def _put(data: Data, override: Override) -> tuple[KeyPath, list[KeyPath]]:
    """Write into ``data``; returns the path with indices for names, and the mappings created."""
    node = data
    done: KeyPath = ()
    created: list[KeyPath] = []
    for number, raw in enumerate(override.path):
        last = number == len(override.path) - 1
        step: str | int = str(raw)
        if isinstance(node, list):
            step = _index(node, raw, done, override)
        elif not isinstance(node, dict):
            holder, value = key_text(done) or "the file", f"{node!r:.40}"
            value = "empty" if node is None else value
            raise override.error(f"{holder} is {value} and contains no {step!r}")
        done = (*done, step)
        if last:
            node[step] = copy.deepcopy(override.value)
            break
        if isinstance(node, dict) and node.get(step) is None:
            node[step] = {}
            created.append(done)
        node = node[step]
    return done, created


def _index(node: list[Data], step: str | int, done: KeyPath, override: Override) -> int:
    if isinstance(step, int):
        if step >= len(node):
            raise override.error(f"{key_text(done)} has {len(node)} items, counted from 0")
        return step
    names = [str(item.get("name")) if isinstance(item, dict) else "" for item in node]
    if step in names:
        return names.index(step)
    given_names = list(filter(None, names))
    wanted = "an index or a name" if given_names else "an index"
    near = f"; {did_you_mean(step, given_names)}" if given_names else ""
    raise override.error(f"{key_text(done)} is a list: expected {wanted}, got {step!r}{near}")


def layered(
    lower: YamlDocument, upper: YamlDocument, replaced: Container[str] = ()
) -> YamlDocument:
    """Put ``upper`` on top of ``lower``: mappings are merged key by key, other values replaced.

    The mappings at the top-level keys ``replaced`` are not merged but replaced. Each part keeps its
    origin.

    >>> from navfw.config.document import parse_yaml
    >>> lower, upper = parse_yaml("a: {x: 1, y: 2}"), parse_yaml("a: {y: 3}")
    >>> layered(lower, upper).data, layered(lower, upper, {"a"}).data
    ({'a': {'x': 1, 'y': 3}}, {'a': {'y': 3}})
    """
    origins = {path: _named(origin, lower) for path, origin in lower.origins.items()}
    data = copy.deepcopy(lower.data)
    _merge(data, origins, upper, (), replaced)
    return YamlDocument(upper.file, data, MappingProxyType(origins))


def on_its_base(
    document: YamlDocument,
    path: Path,
    kind: str,
    replaced: Container[str] = (),
    load: Callable[[Path], YamlDocument] = load_yaml,
    above: tuple[Path, ...] = (),
) -> YamlDocument:
    """Put ``document``, the file at ``path``, on top of the file named by its key ``base``.

    That may have a ``base`` as well. ``kind`` is that of all, ``load`` reads one; for ``replaced``
    see ``layered``.

    Raises:
        ConfigError: a base cannot be read, or the file is based on itself.
        UnknownNameError: a base does not exist.

    """
    name = document.data.get("base")
    if not isinstance(name, str):
        return document
    seen = (*above, real_path(path))
    with document.locating(("base",)):
        file = find(kind, name, base=path.parent)
        if real_path(file) in seen:
            raise ConfigError(f"the {kind} is based on itself; name another one")
    base = on_its_base(load(file), file, kind, replaced, load, seen)
    return layered(base, document, replaced)


def _merge(
    node: Data,
    origins: dict[KeyPath, Origin],
    upper: YamlDocument,
    at: KeyPath,
    replaced: Container[str],
) -> None:
    """Write the part of ``upper`` at path ``at`` into the mapping ``node``, and its origins."""
    for key, value in upper.at(at).items():
        path = (*at, key)
        merged = not (len(path) == 1 and key in replaced)
        if merged and isinstance(value, dict) and isinstance(node.get(key), dict):
            origins[path] = _named(upper.origin_of(path), upper)
            _merge(node[key], origins, upper, path, replaced)
            continue
        node[key] = copy.deepcopy(value)
        _forget(origins, path)
        below = {p: o for p, o in upper.origins.items() if p[: len(path)] == path}
        origins.update({p: _named(origin, upper) for p, origin in below.items()})


def _named(origin: Origin, document: YamlDocument) -> Origin:
    """Return ``origin`` with the file of ``document`` where it names none."""
    return Origin(origin.file or document.file, origin.line, origin.option)
