"""The kernels that are compiled ahead of need, with the types of their arguments.

``kernels.json`` lists the functions that Python calls, by module, each with its signatures;
``tests/helpers/kernel_recording.py`` writes it from drives. What they call is compiled with them. A
kernel or a signature that is not listed is compiled when it is first called.
"""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import networkx
import numba
from numba.extending import is_jitted

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


KERNEL_FILE = Path(__file__).with_name("kernels.json")
"""Module: function: its signatures."""


@dataclass(frozen=True, slots=True)
class Kernel:
    """A compiled function: numba's dispatcher, and the argument types to compile it for."""

    name: str
    function: Any
    signatures: tuple[tuple[Any, ...], ...]

    @property
    def missing(self) -> bool:
        """Whether numba's cache on disk lacks a signature, or is older than the source."""
        cache = self.function._cache
        if not hasattr(cache, "_cache_file"):
            return False  # numba found no folder to write to: nothing can be kept
        stored = cache._cache_file._load_index()
        codegen = self.function.targetctx.codegen()
        return any(cache._index_key(types, codegen) not in stored for types in self.signatures)

    @property
    def cache_folder(self) -> Path:
        """The folder into which numba writes the compiled function."""
        return Path(self.function._cache.cache_path)

    @property
    def calls(self) -> set[Any]:
        """The compiled functions that it calls, directly or not, and itself."""
        found, new = {self.function}, [self.function]
        while new:
            code = new.pop().py_func
            known = (code.__globals__.get(name) for name in code.__code__.co_names)
            new += [function for function in known if is_jitted(function) and function not in found]
            found.update(new)
        return found

    @property
    def size(self) -> int:
        """Length of the byte code that is compiled [byte]: the time grows with it."""
        length = sum(len(function.py_func.__code__.co_code) for function in self.calls)
        return length * len(self.signatures)

    def compile(self) -> None:
        """Compile what the cache lacks, and keep it there."""
        for types in self.signatures:
            self.function.compile(types)


def listed_kernels(loaded: bool = False) -> list[Kernel]:
    """The kernels of ``kernels.json``; with ``loaded`` those of the modules imported by now.

    None where numba is told not to compile (NUMBA_DISABLE_JIT).
    """
    return list(_kernels(json.loads(KERNEL_FILE.read_text(encoding="utf-8")), loaded))


def _kernels(content: dict[str, dict[str, list[str]]], loaded: bool) -> Iterator[Kernel]:
    for module, functions in content.items():
        if loaded and module not in sys.modules:
            continue
        space = vars(importlib.import_module(module))
        for name, signatures in functions.items():
            if is_jitted(space[name]):
                types = tuple(parse_types(signature) for signature in signatures)
                yield Kernel(f"{module}.{name}", space[name], types)


def groups_of(kernels: Sequence[Kernel]) -> list[list[Kernel]]:
    """The kernels in groups that have no function in common, the largest first.

    Two processes that compile different groups compile no function twice.
    """
    graph = networkx.Graph()
    by_function = {kernel.function: kernel for kernel in kernels}
    for kernel in kernels:
        graph.add_edges_from((kernel.function, called) for called in kernel.calls)
    groups = (
        [kernel for function, kernel in by_function.items() if function in part]
        for part in networkx.connected_components(graph)
    )
    return sorted(groups, key=lambda group: sum(kernel.size for kernel in group), reverse=True)
