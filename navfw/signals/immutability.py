"""Immutable values: what passes between stages cannot be changed by the plugins that get it."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, ClassVar, TypeVar

import numpy as np

_LEAVES = frozenset((float, str, int, bool, type(None)))
_MAPPINGS = (dict, MappingProxyType)
"""Mappings that are copied; a mapping of any other type has to be immutable itself."""
_REPLACED = (tuple, *_MAPPINGS)
ArrayT = TypeVar("ArrayT", bound=np.ndarray[Any, Any])


def read_only(array: ArrayT) -> ArrayT:
    """Return a copy of ``array`` that cannot be written; ``array`` itself if it is read-only."""
    if not array.flags.writeable:
        return array
    copy = array.copy()
    copy.setflags(write=False)
    return copy


def immutable(value: Any) -> Any:
    """Return ``value`` with its arrays, mappings, lists and sets replaced by immutable copies."""
    kind = type(value)
    if kind in _LEAVES:
        return value
    if isinstance(value, _MAPPINGS):
        # most items are leaves: no need of a call for each
        return MappingProxyType(
            {key: v if type(v) in _LEAVES else immutable(v) for key, v in value.items()}
        )
    if isinstance(value, np.ndarray):
        return read_only(value)
    if kind is list or kind is tuple:
        return tuple(immutable(item) for item in value)
    return frozenset(value) if kind is set else value


class Frozen:
    """A base of frozen dataclasses: arrays, mappings and tuples in them become immutable copies.

    Any other value stays as it is: it is for the checks of what a plugin returns to refuse it.
    """

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __post_init__(self) -> None:
        """Replace what can be changed."""
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, read_only(value))
            elif type(value) not in _LEAVES and isinstance(value, _REPLACED):
                object.__setattr__(self, name, immutable(value))


class Sealed:
    """Base class of read-only objects: ``_seal()``, last in ``__init__``, forbids assignments."""

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
