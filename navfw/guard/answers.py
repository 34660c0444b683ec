"""Checks of what plugins return: type, shape, finiteness, range.

Each check returns the answer with immutable float64 arrays, immutable mappings and Python numbers,
independent of what the plugin changes later; it is copied only where it has not this form yet.
Checks raise ``AnswerError``; ``what`` is the name of the value in its message.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from operator import is_
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from navfw.guard.answer_kernels import are_degrees, are_finite
from navfw.numerics import Array
from navfw.signals import Pose, Twist
from navfw.signals.immutability import read_only

_ARRAY: Any = np.ndarray
_FLOAT64 = np.dtype(np.float64)

T = TypeVar("T")


class AnswerError(ValueError):
    """An answer of a plugin is invalid."""


def nothing(answer: object) -> None:
    """Accept any answer; the check of a call whose answer is not used."""
    del answer


def instance(answer: object, cls: type[T], call: str) -> T:
    """Return ``answer`` if it is a ``cls``, else raise; ``call`` is the method that returned it."""
    if not isinstance(answer, cls):
        raise AnswerError(f"{call} returned {type(answer).__name__}, not a {cls.__name__}")
    return answer


def rebuilt(answer: object, cls: type[T], **fields: Any) -> T:
    """Make a ``cls`` of the checked ``fields``; return ``answer`` itself if it has the same."""
    if type(answer) is not cls:
        return cls(**fields)
    for name, value in fields.items():
        if getattr(answer, name) is not value:
            return cls(**fields)
    return answer


def number(value: Any, what: str, low: float = -math.inf, high: float = math.inf) -> float:
    """Return ``value`` as a finite float in [low, high]."""
    if type(value) is float and low <= value <= high and abs(value) != math.inf:
        return value  # the usual case, recognised quickly
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
    """Return ``value`` as a degree in [0, 1]."""
    return number(value, what, 0.0, 1.0)


def text(value: Any, what: str) -> str:
    """Return ``value`` as a text."""
    if not isinstance(value, str):
        raise AnswerError(f"{what} is {_named(value)}, expected a text")
    return str(value)


def real(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """Return ``value`` as an immutable, C-contiguous float64 array of ``shape``; NaN is allowed."""
    result: Array
    if (
        type(value) is _ARRAY
        and not value.flags.writeable
        and value.dtype is _FLOAT64
        and value.shape == shape
        and value.flags.c_contiguous
    ):
        result = value  # the usual case, recognised quickly
        return result
    try:
        raw = np.asarray(value)
    except ValueError:
        raise AnswerError(f"{what} is {_named(value)}, expected an array of numbers") from None
    if raw.dtype.kind not in "fiub":
        raise AnswerError(f"{what} has values of type {raw.dtype}, expected float64")
    if raw.shape != shape:
        raise AnswerError(f"{what} has shape {raw.shape}, expected {shape}")
    result = contiguous(raw, _FLOAT64)
    return result


def contiguous(array: Any, dtype: np.dtype[Any]) -> Any:
    """Return ``array`` as an immutable, C-contiguous array of ``dtype``; a copy only if needed."""
    if array.dtype != dtype or not array.flags.c_contiguous:
        array = np.ascontiguousarray(array, dtype=dtype)
    return read_only(array)


def array(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """Return ``value`` as an immutable float64 array of ``shape``, all values finite."""
    result = real(value, what, shape)
    if not are_finite(result):
        raise AnswerError(f"{what} has values that are not finite")
    return result


def degrees(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """Return ``value`` as an immutable float64 array of ``shape``, all in [0, 1] up to rounding."""
    result = real(value, what, shape)
    if not are_degrees(result):
        array(result, what, shape)  # raises where values are not finite
        span = f"{result.min():g} to {result.max():g}"
        raise AnswerError(f"{what} has values outside [0, 1]: {span}")
    return result


def items(value: Any, what: str) -> Sequence[Any]:
    """Return ``value``, a sequence but no text, as a tuple."""
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise AnswerError(f"{what} is {_named(value)}, expected a sequence")
    return tuple(value)


def mapping(value: Any, what: str) -> dict[str, Any]:
    """Return ``value`` as a new dictionary with texts as keys."""
    if type(value) is not MappingProxyType and not isinstance(value, Mapping):
        raise AnswerError(f"{what} is {_named(value)}, expected a mapping")
    return {text(key, f"a key of {what}"): item for key, item in value.items()}


def mapping_of(value: Any, what: str, check: Callable[[Any, str], T]) -> Mapping[str, T]:
    """Return ``value`` as a mapping of texts to checked items; itself if that changes nothing."""
    result = {name: check(item, f"{what}.{name}") for name, item in mapping(value, what).items()}
    same = type(value) is MappingProxyType and all(map(is_, result.values(), value.values()))
    return value if same else result


def pose(value: Any, what: str) -> Pose:
    """Return ``value`` as a pose of finite numbers."""
    instance(value, Pose, what)
    x, y, yaw = number(value.x, "x"), number(value.y, "y"), number(value.yaw, "yaw")
    return rebuilt(value, Pose, x=x, y=y, yaw=yaw)


def twist(value: Any, what: str) -> Twist:
    """Return ``value`` as a twist of finite numbers."""
    instance(value, Twist, what)
    v, w = value.v, value.w
    if type(value) is Twist and type(v) is type(w) is float and math.isfinite(v + w):
        return value  # the usual case, recognised quickly
    return rebuilt(value, Twist, v=number(v, "v"), w=number(w, "w"))


def _named(value: object) -> str:
    return f"a {type(value).__name__}"
