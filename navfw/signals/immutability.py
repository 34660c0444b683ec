"""Immutable values: what passes between stages cannot be changed by the plugins that get it."""

from __future__ import annotations

from collections.abc import MutableMapping
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

_LEAVES = frozenset((float, str, int, bool, type(None)))
_MAPPINGS = (MutableMapping, MappingProxyType)
"""Mappings that are copied; a mapping of any other type has to be immutable itself."""
_REPLACED = (np.ndarray, dict, tuple, *_MAPPINGS)
ArrayT = TypeVar("ArrayT", bound=np.ndarray[Any, Any])


def read_only(array: ArrayT) -> ArrayT:
    """A copy of ``array`` that cannot be written to; ``array`` itself if it is one already."""
    if not array.flags.writeable:
        return array
    copy = array.copy()
    copy.flags.writeable = False
    return copy


def immutable(value: Any) -> Any:
    """``value`` with its arrays, mappings, lists and sets replaced by immutable copies."""
    kind = type(value)
    if kind in _LEAVES:
        return value
    if kind is dict or isinstance(value, _MAPPINGS):
        # most items are leaves: no need of a call for each
        return MappingProxyType(
            {key: v if type(v) in _LEAVES else immutable(v) for key, v in value.items()}
        )
    if isinstance(value, np.ndarray):
        return read_only(value)
    if kind is list or kind is tuple:
        return tuple(immutable(item) for item in value)
    return frozenset(value) if kind is set else value


def freeze(instance: object, *names: str) -> None:
    """Make the fields ``names`` of a frozen dataclass immutable; for its ``__post_init__``.

    Arrays, mappings and tuples are replaced by immutable copies. Any other value stays as it is:
    it is for the checks of what a plugin returns to refuse it.
    """
    for name in names:
        if isinstance(value := getattr(instance, name), _REPLACED):
            object.__setattr__(instance, name, immutable(value))


class Sealed:
    """A base of classes whose ``__init__`` ends with ``_seal()``: no attribute can be set then."""

    _sealed = False

    def _seal(self) -> None:
        self._sealed = True

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute, before ``_seal``.

        Raises:
            AttributeError: the instance is sealed.

        """
        if self._sealed:
            raise AttributeError(f"{type(self).__name__} is read only: cannot set {name!r}")
        super().__setattr__(name, value)
