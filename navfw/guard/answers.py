"""Checks of what plugins answer: type, shape, finiteness, range.

Each check returns the answer as a new object with immutable float64 arrays and Python numbers:
nothing behind it depends on what the plugin keeps or changes later. ``AnswerError`` says what is
wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numba
import numpy as np

from navfw.signals import Array, Pose, Twist
from navfw.signals.immutable import read_only

__all__ = [
    "MAX_ITEMS",
    "AnswerError",
    "array",
    "degree",
    "degrees",
    "instance",
    "items",
    "mapping",
    "nothing",
    "number",
    "pose",
    "text",
    "twist",
]

MAX_ITEMS = 10_000
"""Largest number of items in an answer: landmarks in one image, waypoints, places."""

_MAX_TEXT = 10_000
"""Largest length of a text [characters]."""

_ROUNDING = 1e-9
"""By how much a degree may exceed 1: sums and products of degrees round."""

T = TypeVar("T")


class AnswerError(ValueError):
    """An answer of a plugin that cannot be used."""


def nothing(answer: object) -> None:
    """Accept any answer of a call that gives none."""
    del answer


def instance(answer: object, cls: type[T], call: str) -> T:
    """``answer``, which must be a ``cls``; ``call`` is the method that gave it."""
    if not isinstance(answer, cls):
        raise AnswerError(f"{call} returned {type(answer).__name__}, not a {cls.__name__}")
    return answer


def number(value: Any, what: str, low: float = -math.inf, high: float = math.inf) -> float:
    """``value`` as a finite float in [low, high]."""
    if type(value) is float and low <= value <= high and abs(value) != math.inf:
        return value  # the usual case, told quickly
    if isinstance(value, bool | np.bool_) or not isinstance(
        value, int | float | np.integer | np.floating
    ):
        raise AnswerError(f"{what} is {_named(value)}, expected a number")
    result = float(value)
    if not math.isfinite(result):
        raise AnswerError(f"{what} is {result}, expected a finite number")
    if not low <= result <= high:
        raise AnswerError(f"{what} {result:g} is not in [{low:g}, {high:g}]")
    return result


def degree(value: Any, what: str) -> float:
    """``value`` as a degree in [0, 1]."""
    return number(value, what, 0.0, 1.0)


def text(value: Any, what: str) -> str:
    """``value`` as a text of bounded length."""
    if type(value) is str and len(value) <= _MAX_TEXT:
        return value
    if not isinstance(value, str):
        raise AnswerError(f"{what} is {_named(value)}, expected a text")
    return str(value[:_MAX_TEXT])


def array(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """``value`` as an immutable float64 array of that shape, all finite."""
    result = _real(value, what, shape)
    if not np.isfinite(result).all():
        raise AnswerError(f"{what} has values that are not finite")
    return result


def degrees(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """``value`` as an immutable float64 array of that shape, all in [0, 1] up to rounding."""
    result = _real(value, what, shape)
    if not _are_degrees(result):
        raise AnswerError(f"{what} has values outside [0, 1]")
    return result


def items(value: Any, what: str) -> Sequence[Any]:
    """``value`` as a tuple of bounded length."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise AnswerError(f"{what} is {_named(value)}, expected a sequence")
    found: list[Any] = []
    for item in value:
        if len(found) == MAX_ITEMS:
            raise AnswerError(f"{what} has more than {MAX_ITEMS} items")
        found.append(item)
    return tuple(found)


def mapping(value: Any, what: str) -> dict[str, Any]:
    """``value`` as a new dictionary of bounded size with texts as keys."""
    if not isinstance(value, Mapping):
        raise AnswerError(f"{what} is {_named(value)}, expected a mapping")
    if len(value) > MAX_ITEMS:
        raise AnswerError(f"{what} has more than {MAX_ITEMS} items")
    return {text(key, f"a key of {what}"): item for key, item in value.items()}


def pose(value: Any, what: str) -> Pose:
    """``value`` as a pose of finite numbers."""
    instance(value, Pose, what)
    return Pose(number(value.x, "x"), number(value.y, "y"), number(value.yaw, "yaw"))


def twist(value: Any, what: str) -> Twist:
    """``value`` as a twist of finite numbers."""
    instance(value, Twist, what)
    return Twist(number(value.v, "v"), number(value.w, "w"))


def _real(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """``value`` as an immutable, C-contiguous float64 array of that shape."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raise AnswerError(f"{what} is {_named(value)}, expected an array of numbers") from None
    if raw.dtype.kind not in "fiub":
        raise AnswerError(f"{what} has values of type {raw.dtype}, expected float64")
    if raw.shape != shape:
        raise AnswerError(f"{what} has shape {raw.shape}, expected {shape}")
    return read_only(raw.astype(np.float64, copy=False))


@numba.njit(cache=True)
def _are_degrees(values: Array) -> bool:  # pragma: no cover - compiled
    """Whether all ``values`` are in [0, 1], up to rounding; NaN is not."""
    valid = True
    for value in values.flat:
        valid = valid and bool(0.0 <= value <= 1.0 + _ROUNDING)
    return valid


def _named(value: object) -> str:
    return f"a {type(value).__name__}"
