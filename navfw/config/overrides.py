"""Single values given on the command line: ``--set offis.layers=1``, or in Python by a mapping."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TypeAlias

from navfw.config.document import Data, KeyPath, Origin, YamlDocument, key_text, parse_yaml
from navfw.errors import ConfigError, did_you_mean

Settings: TypeAlias = str | Sequence[str] | Mapping[str, object]
"""Overrides: texts such as ``"offis.layers=1"``, or a mapping such as ``{"offis.layers": 1}``."""


@dataclass(frozen=True)
class Override:
    """Set ``path`` to ``value``; ``text`` is the option's argument as typed."""

    path: KeyPath
    value: Data
    text: str

    @property
    def option(self) -> str:
        """The option as error messages show it."""
        return f"--set {self.text}"

    def under(self, prefix: KeyPath) -> Override:
        """The same override with ``prefix`` before its path."""
        return replace(self, path=(*prefix, *self.path))

    def error(self, message: str) -> ConfigError:
        """An error whose key is this override."""
        return ConfigError(message, key=self.option)


def override_texts(given: Settings) -> tuple[str, ...]:
    """Overrides as arguments of ``--set``; the values of a mapping are plain data.

    >>> override_texts({"offis.layers": 1, "mission.goals": ["lab"]})
    ('offis.layers=1', 'mission.goals=["lab"]')
    >>> override_texts("offis.layers=1")
    ('offis.layers=1',)

    Raises:
        ConfigError: a value is no plain data: neither number, text, boolean, None, list nor
            mapping, or a number that is not finite.

    """
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Mapping):
        return tuple(str(text) for text in given)
    return tuple(f"{key}={_value_text(key, value)}" for key, value in given.items())


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
    if not equals:
        raise ConfigError("expected key=value", key=f"--set {text}")
    if not all(steps):
        raise ConfigError("expected key=value with keys like a.b", key=f"--set {text}")
    try:
        data = parse_yaml(value).data
    except ConfigError as error:
        raise ConfigError(
            f"expected a YAML value after '=': {error}", key=f"--set {text}"
        ) from None
    return Override(tuple(_step(step) for step in steps), data, text)


def apply_overrides(document: YamlDocument, overrides: Sequence[str | Override]) -> YamlDocument:
    """A copy of ``document`` with the overrides in it, later ones over earlier ones.

    Raises:
        ConfigError: an override is malformed, its path leads through a value that is neither a
            mapping nor a list, or it names an item that a list does not have. Keys that the file
            does not have are added; validation rejects unknown ones.

    """
    if not overrides:
        return document
    data = copy.deepcopy(document.data)
    origins = dict(document.origins)
    for given in overrides:
        override = parse_override(given) if isinstance(given, str) else given
        path, created = _put(data, override)
        for known in [p for p in origins if p[: len(path)] == path]:
            del origins[known]
        for part in (path, *created):
            origins[part] = Origin(option=override.option)
    return YamlDocument(document.file, data, MappingProxyType(origins))


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
            raise override.error(
                f"{key_text(done) or 'the file'} is {_shown(node)} and contains no {step!r}"
            )
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
    known = [name for name in names if name]
    wanted = "an index or a name" if known else "an index"
    near = f"; {did_you_mean(step, known)}" if known else ""
    raise override.error(f"{key_text(done)} is a list: expected {wanted}, got {step!r}{near}")


def _shown(node: Data) -> str:
    return "empty" if node is None else f"{node!r:.40}"
