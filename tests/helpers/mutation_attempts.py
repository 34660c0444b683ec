"""Try to change a value, and all that is reachable from it by public names."""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import functools
import inspect
import types
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from navfw.signals import Sealed

_LEAVES = (type(None), bool, int, float, str, bytes, slice, enum.Enum, Path, np.generic)
_KNOWN = (np.ndarray, frozenset, tuple, Mapping, BaseModel, Sealed)
_WITHOUT_ATTRIBUTES = (np.ndarray, frozenset, tuple, types.MappingProxyType)
_REFUSALS = (AttributeError, TypeError, ValueError)  # pydantic's and dataclasses' are among them


def changeable(value: object, path: str = "it") -> list[str]:
    """The paths at which ``value`` or something reachable from it could be changed.

    What refuses all attempts counts as changeable all the same if its type is not a known one.
    """
    return sorted(set(_changeable(value, path, {})))


def _changeable(value: object, path: str, visited: dict[int, object]) -> Iterator[str]:
    if id(value) in visited or isinstance(value, _LEAVES) or inspect.isroutine(value):
        return
    visited[id(value)] = value
    known = dataclasses.is_dataclass(value) or isinstance(value, _KNOWN)
    if not known or any(_succeeds(attempt) for attempt in _attempts(value)):
        yield path
    for name in [*_attributes(value), "an_additional_attribute"]:
        if _succeeds(functools.partial(_set, value, name)):
            yield f"{path}.{name}"
    for part, get in _parts(value):
        item = get()
        if item is get():  # what is made anew at each access is the reader's own
            yield from _changeable(item, f"{path}{part}", visited)


def _attempts(value: Any) -> Iterator[Callable[[], object]]:
    """The ways to change an array or a mapping itself."""
    if isinstance(value, np.ndarray):
        yield from _array_attempts(value)
    elif isinstance(value, Mapping):
        key = next(iter(value), "an additional key")
        yield lambda: value.__setitem__(key, value.get(key))  # type: ignore[index]
        yield lambda: value.update({})  # type: ignore[attr-defined]


def _parts(value: Any) -> Iterator[tuple[str, Callable[[], object]]]:
    """How to read each part of ``value``, and the part's name."""
    if isinstance(value, frozenset | tuple):
        for index, item in enumerate(value):
            yield f"[{index}]", lambda item=item: item  # type: ignore[misc]
    elif isinstance(value, Mapping):
        for key in value:
            yield f"[{key!r}]", functools.partial(value.__getitem__, key)
    for name in _attributes(value):
        yield f".{name}", functools.partial(getattr, value, name)


def _attributes(value: object) -> list[str]:
    """The public attributes of an instance: fields, variables, slots and properties."""
    if isinstance(value, _WITHOUT_ATTRIBUTES):
        return []
    cls = type(value)
    names: dict[str, None] = {}
    if dataclasses.is_dataclass(value):
        names.update(dict.fromkeys(field.name for field in dataclasses.fields(value)))
    if isinstance(value, BaseModel):
        names.update(dict.fromkeys(cls.model_fields))  # type: ignore[attr-defined]
    names.update(dict.fromkeys(getattr(value, "__dict__", {})))
    for base in cls.__mro__:
        if base in (object, BaseModel):
            continue
        for name, member in vars(base).items():
            if isinstance(
                member, property | functools.cached_property | types.MemberDescriptorType
            ):
                names[name] = None
    return [name for name in names if not name.startswith(("_", "model_"))]


def _set(value: object, name: str) -> None:
    setattr(value, name, getattr(value, name, 0))


def _array_attempts(array: np.ndarray[Any, Any]) -> Iterator[Callable[[], object]]:
    """Write, and make writable: the array, and every array whose memory it shows."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        yield functools.partial(owner.__setitem__, ..., owner.copy())
        yield functools.partial(owner.setflags, write=True)
        yield functools.partial(setattr, owner.flags, "writeable", True)
        owner = owner.base
    if isinstance(owner, bytearray | memoryview):
        yield lambda: None


def _succeeds(attempt: Callable[[], object]) -> bool:
    with contextlib.suppress(*_REFUSALS):
        attempt()
        return True
    return False
