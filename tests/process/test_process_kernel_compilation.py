"""Kernels compiled ahead of need: their list, their groups, and one process at a time."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from kernel_recording import expression, listed_calls
from processes import printed

from navfw.process import listed_kernels
from navfw.process.kernel_compilation import groups_of, parse_types

COMPILE = """
import sys
from navfw.process import kernel_compilation
from navfw.guard.answer_kernels import are_degrees, are_finite
from navfw.process.kernel_compilation import Kernel, parse_types
one, two = (parse_types(f"Array(float64, 1, 'C', readonly={word})") for word in (False, True))
kernels = [Kernel(str(f), f, (one, two)) for f in (are_degrees, are_finite)]
kernel_compilation.listed_kernels = lambda loaded=False: kernels
shown = []
compiled = kernel_compilation.compile_kernels(shown.append)
print(compiled, any(k.missing for k in kernels))
print(*(f"{state.done}/{state.total}" for state in shown))
compiled = [s for k in kernels for s in k.function.stats.cache_misses.values()]
print("compiled here:", sum(compiled))
"""


def compiler(cache: Path, code: str = COMPILE) -> subprocess.Popen[str]:
    """A process that compiles two small kernels into ``cache``."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    return subprocess.Popen(  # noqa: S603 - the interpreter of this test
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
    )


def test_names_of_types_are_read_as_they_are_written() -> None:
    text = "Array(uint8, 2, 'A', readonly=True), Tuple((UniTuple(int64, 3), boolean)), float64"
    types = parse_types(text)
    assert ", ".join(map(expression, types)) == text
    assert not types[0].mutable
    assert parse_types("") == ()


def test_the_list_names_kernels_that_exist_with_the_number_of_their_arguments() -> None:
    listed = listed_kernels()
    assert sum(map(len, listed_calls().values())) == len(listed) > 50
    for kernel in listed:
        count = kernel.function.py_func.__code__.co_argcount
        assert {len(types) for types in kernel.signatures} == {count}, kernel.name


def test_groups_hold_every_kernel_once_and_have_no_function_in_common() -> None:
    listed = listed_kernels()
    groups = groups_of(listed)
    names = [kernel.name for group in groups for kernel in group]
    assert sorted(names) == sorted(kernel.name for kernel in listed)
    called = [set().union(*(kernel.calls for kernel in group)) for group in groups]
    assert sum(map(len, called)) == len(set().union(*called)) > len(names)
    assert len(groups) > 20  # enough for many cores


@pytest.mark.thorough
def test_workers_compile_and_a_second_process_finds_all_compiled(tmp_path: Path) -> None:
    first = compiler(tmp_path).communicate(timeout=300)[0].splitlines()
    assert first[0] == "2 False"
    assert first[1].split()[0] == "0/2"
    assert first[1].split()[-1] == "2/2"
    assert first[2] == "compiled here: 0"  # but by the workers
    assert compiler(tmp_path).communicate(timeout=300)[0].splitlines()[:2] == ["0 False", ""]


BOTH_AT_ONCE = """
import os, pathlib, time
ready = pathlib.Path(os.environ["NUMBA_CACHE_DIR"])
(ready / f"{os.getpid()}.ready").touch()
while len(list(ready.glob("*.ready"))) < 2:
    time.sleep(0.01)
compile_ = Kernel.compile
Kernel.compile = lambda self: (time.sleep(1.0), compile_(self))
shown = []
"""


@pytest.mark.slow
def test_only_one_of_two_processes_compiles(tmp_path: Path) -> None:
    code = COMPILE.replace("shown = []", BOTH_AT_ONCE)
    processes = [compiler(tmp_path, code) for _ in range(2)]
    texts = [process.communicate(timeout=300)[0] for process in processes]
    assert sorted(text.splitlines()[0] for text in texts) == ["0 False", "2 False"]
    assert len(list(tmp_path.rglob("*.nbc"))) == 4


@pytest.mark.parametrize(
    ("work", "end"),
    [("__import__('os')._exit(1)", ["2 True", "0/2 0/2"]), ("__import__('time').sleep(99)", [])],
    ids=["a worker dies", "Ctrl-C"],
)
def test_what_workers_leave_stays_uncompiled(tmp_path: Path, work: str, end: list[str]) -> None:
    code = COMPILE.replace("shown = []", f"shown = []\nKernel.compile = lambda self: {work}")
    code = code.replace("compiled = kernel", "print('begun', flush=True)\ncompiled = kernel", 1)
    process = compiler(tmp_path, code)
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    if not end:
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
    began = time.monotonic()
    assert process.communicate(timeout=60)[0].splitlines()[:2] == end
    assert (process.returncode == 0) == bool(end)
    assert time.monotonic() - began < 30.0


def test_workers_end_with_their_process(tmp_path: Path) -> None:
    code = COMPILE.replace(
        "shown = []",
        "shown = []\nKernel.compile = lambda self: __import__('time').sleep(0.5)\n"
        "kernels *= 20\nkernel_compilation.groups_of = lambda k: [[one] for one in k]\n"
        "print('begun', flush=True)",
    )
    process = compiler(tmp_path, code)
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    time.sleep(1.0)
    process.kill()
    # the pipe closes once no worker holds it any more
    began = time.monotonic()
    process.communicate(timeout=60)
    assert time.monotonic() - began < 8.0


DRIVES = """
from numba.core.event import Listener, register
from navfw.missions import prepare
from navfw.process import compile_kernels
compile_kernels()
class Compilations(Listener):
    def on_start(self, event):
        print(event.data["dispatcher"].py_func.__qualname__, event.data["args"])
    def on_end(self, event):
        pass
register("numba:compile", Compilations())
for world, mission, stack in (
    ("office", "lobby-to-lab", "default"),
    ("office", "lobby-to-lab", "paper"),
    ("office", "patrol", "floor_plan"),
    ("hospital", "find-yourself", "landmarks"),
    ("empty", "straight", "poles"),
):
    prepare(world, mission, stack=stack, overrides=("mission.timeout=4",)).run()
"""


@pytest.mark.slow
def test_nothing_is_compiled_in_a_drive_after_warm() -> None:
    assert not printed(DRIVES), "run: uv run python tests/helpers/kernel_recording.py"
