"""Numba's types by their names: the argument types of kernels, as ``kernels.json`` lists them.

The names are those that numba prints: ``float64``, ``array(float64, 2d, C)``,
``readonly array(uint8, 2d, C)``, ``UniTuple(int64 x 4)``, ``Tuple(...)`` of any of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numba

_types: Any = numba.types

_SCALARS = {
    str(scalar): scalar
    for scalar in (
        _types.boolean,
        _types.int8,
        _types.int32,
        _types.int64,
        _types.uint8,
        _types.float32,
        _types.float64,
    )
}
_ARRAY = re.compile(r"(readonly )?array\((\w+), (\d)d, ([CFA])\)")
_UNIFORM = re.compile(r"UniTuple\((\w+) x (\d+)\)")
_MIXED = re.compile(r"Tuple\((.+)\)")


def parse_types(text: str) -> tuple[Any, ...]:
    """The numba types that ``text`` names, separated by commas; "" names none.

    Raises:
        ValueError: a name is not understood.

    """
    return tuple(_parse(name) for name in _names(text))


def _names(text: str) -> Iterator[str]:
    """The parts of ``text`` between those commas that are in no parentheses."""
    depth, begin = 0, 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            yield text[begin:place].strip()
            begin = place + 1
    if text:
        yield text[begin:].strip()


def _parse(name: str) -> Any:
    """The type of one name."""
    if name in _SCALARS:
        return _SCALARS[name]
    if found := _ARRAY.fullmatch(name):
        readonly, element, dimensions, layout = found.groups()
        return _types.Array(_parse(element), int(dimensions), layout, readonly=bool(readonly))
    if found := _UNIFORM.fullmatch(name):
        return _types.UniTuple(_parse(found[1]), int(found[2]))
    if found := _MIXED.fullmatch(name):
        return _types.Tuple(parse_types(found[1]))
    raise ValueError(f"no type of a kernel's argument: {name!r}")
