"""Compiles kernels before they are needed, on all cores, one process at a time per cache folder.

``kernels.json`` lists the functions that Python calls, by module, each with its signatures;
``tests/helpers/kernel_recording.py`` writes it from drives. Functions that they call are compiled
with them. A kernel or a signature that is not listed is compiled when it is first called.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import networkx
from numba.core import sigutils
from numba.extending import is_jitted

from navfw.process.interruption import check_interrupted
from navfw.process.process_resources import usable_cores
from navfw.process.target_lock import TargetInUseError, TargetLock

PERIOD = 0.5
"""Wall time [s] between two reports while nothing is finished."""

KERNEL_FILE = Path(__file__).with_name("kernels.json")
"""JSON: the signatures of each function, by module and function."""


def parse_types(text: str) -> tuple[Any, ...]:
    """Parse a list of numba types, named as in ``numba.types`` and separated by commas."""
    normalize: Any = sigutils.normalize_signature  # has no types
    return tuple(normalize(f"({text},)" if text else "()")[0])


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
    def calls(self) -> set[Any]:
        """The kernel's function and all compiled functions that it calls, directly or not."""
        called, new = {self.function}, [self.function]
        while new:
            code = new.pop().py_func
            globals_ = (code.__globals__.get(name) for name in code.__code__.co_names)
            new += [value for value in globals_ if is_jitted(value) and value not in called]
            called.update(new)
        return called

    @property
    def size(self) -> int:
        """Length of the byte code to compile [byte], to which the time is roughly proportional."""
        length = sum(len(function.py_func.__code__.co_code) for function in self.calls)
        return length * len(self.signatures)

    def compile(self) -> None:
        """Compile the signatures that numba's cache lacks, and write them to the cache."""
        for types in self.signatures:
            self.function.compile(types)


def listed_kernels(loaded: bool = False) -> list[Kernel]:
    """Return the kernels of ``kernels.json``; if ``loaded``, only those of imported modules.

    Empty if numba does not compile (NUMBA_DISABLE_JIT).
    """
    kernels = []
    for module, functions in json.loads(KERNEL_FILE.read_text(encoding="utf-8")).items():
        if loaded and module not in sys.modules:
            continue
        space = vars(importlib.import_module(module))
        for name, signatures in functions.items():
            if is_jitted(space[name]):
                types = tuple(parse_types(signature) for signature in signatures)
                kernels.append(Kernel(f"{module}.{name}", space[name], types))
    return kernels


def groups_of(kernels: Sequence[Kernel]) -> list[list[Kernel]]:
    """Divide the kernels into groups that have no function in common, the largest first.

    Two processes that compile different groups compile no function twice.
    """
    graph = networkx.Graph()
    by_function = {kernel.function: kernel for kernel in kernels}
    for kernel in kernels:
        graph.add_edges_from((kernel.function, called) for called in kernel.calls)
    groups = (
        [kernel for function, kernel in by_function.items() if function in component]
        for component in networkx.connected_components(graph)
    )
    return sorted(groups, key=lambda group: sum(kernel.size for kernel in group), reverse=True)


# --- compilation ----------------------------------------------------------------------------------


COMPILING = "compiling navfw's routines for this machine; this happens only once"
"""The message when the first kernels are compiled."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """The progress of the compilation: kernels, ``share`` of the work, estimated time ``left`` [s].

    ``left`` is None until it can be estimated within a factor of two.
    """

    done: int
    total: int
    share: float
    left: float | None

    def __str__(self) -> str:
        about = "" if self.left is None else f", about {max(self.left, 1.0):.0f} s left"
        return f"{self.done} of {self.total}{about}"


Report = Callable[[Compiled], object]
"""A function that is called with the progress of the compilation."""


_TRUSTED = 0.25
"""Share of the work from which on the time left can be estimated within a factor of two."""


def _state(kernels: Sequence[Kernel], began: float) -> Compiled:
    """How many of ``kernels`` are in numba's cache, since ``began`` [s, monotonic].

    The time of a kernel grows with its size.
    """
    missing = [kernel.size for kernel in kernels if kernel.missing]
    share = 1.0 - sum(missing) / sum(kernel.size for kernel in kernels)
    left = (time.monotonic() - began) * (1.0 / share - 1.0) if share > _TRUSTED else None
    return Compiled(len(kernels) - len(missing), len(kernels), share, left)


def compile_kernels(report: Report | None = None, *, loaded: bool = False) -> int:
    """Compile the listed kernels that numba's cache lacks; return their number.

    With ``loaded``, only those of imported modules. ``report`` is called only if there are any,
    every ``PERIOD``. While another process compiles, this one waits and compiles nothing. In a
    process that may not have children, the kernels are compiled one after the other.

    Raises:
        KeyboardInterrupt: a signal has arrived; what was compiled by then is kept.

    """
    show = report or (lambda state: None)
    missing = [kernel for kernel in listed_kernels(loaded) if kernel.missing]
    if not missing:
        return 0
    cache = Path(missing[0].function._cache.cache_path)
    lock = TargetLock((cache.parent / "kernels").absolute())
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # not writable: every process compiles for itself
            _wait_for(lock, missing, show)
            stack.callback(lock.release)
        missing = [kernel for kernel in missing if kernel.missing]
        if multiprocessing.current_process().daemon:
            for kernel in missing:
                kernel.compile()
        elif missing:
            _compile_groups(groups_of(missing), show)
    return len(missing)


def _wait_for(lock: TargetLock, missing: Sequence[Kernel], show: Report) -> None:
    """Take the lock; meanwhile show what its holder has compiled."""
    began = time.monotonic()
    while True:
        try:
            return lock.acquire(PERIOD)
        except TargetInUseError:
            check_interrupted()
            show(_state(missing, began))


def _compile_groups(groups: Sequence[Sequence[Kernel]], show: Report) -> None:
    """Compile ``groups`` in a process for each core, forked on Linux, so that they need no imports.

    If one of the processes dies, the rest is compiled when it is called.
    """
    workers, began = min(usable_cores(), len(groups)), time.monotonic()
    kernels = [kernel for group in groups for kernel in group]
    forked = sys.platform == "linux" and hasattr(os, "fork")
    context = multiprocessing.get_context("fork" if forked else "spawn")
    with ProcessPoolExecutor(workers, context, _begin_worker) as pool:
        unfinished = set()
        try:
            with contextlib.suppress(BrokenProcessPool):
                unfinished = {pool.submit(_compile, [k.name for k in group]) for group in groups}
            while unfinished:
                show(_state(kernels, began))
                unfinished = wait(unfinished, PERIOD).not_done
                check_interrupted()
        except BaseException:
            for process in (pool._processes or {}).values():
                process.terminate()
            raise
    show(_state(kernels, began))


# --- in a worker process --------------------------------------------------------------------------


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all: the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        parent.join()
        os._exit(1)


@functools.cache
def _by_name() -> dict[str, Kernel]:
    return {kernel.name: kernel for kernel in listed_kernels()}


def _compile(names: Sequence[str]) -> None:
    for name in names:
        _by_name()[name].compile()
