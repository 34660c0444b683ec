"""The guard around plugin calls: what is contained, recorded, suspended, let through, or ended."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any, NoReturn

import numba
import pytest

from navfw.errors import InputError
from navfw.guard import PluginCallError, PluginGuard, number
from navfw.guard.answers import nothing
from navfw.guard.plugin_guard import MAX_SUSPENSION, SUSPENSION
from navfw.process import PluginTimeout
from navfw.process.interruption import interruptible
from navfw.process.process_resources import processor_wait
from navfw.process.watchdog import PERIOD, Watchdog


class OwnBaseError(BaseException):
    """Not an Exception."""


class Unprintable(Exception):  # noqa: N818 - as a plugin might call it
    """Its message raises."""

    def __str__(self) -> str:
        raise TypeError("no text")


def raiser(error: BaseException) -> Callable[[], NoReturn]:
    """A function that raises ``error``."""

    def call() -> NoReturn:
        raise error

    return call


def fail(guard: PluginGuard, plugin: str, error: BaseException, **options: Any) -> None:
    """A call of ``plugin`` that raises ``error``."""
    with pytest.raises(PluginCallError, match=f"^{plugin}: "):
        guard.call(plugin, raiser(error), check=nothing, **options)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ValueError("no\nsense"), "ValueError: no sense"),
        (SystemExit(0), "SystemExit: 0"),
        (KeyboardInterrupt(), "KeyboardInterrupt"),
        (GeneratorExit(), "GeneratorExit"),
        (OwnBaseError("mine"), "OwnBaseError: mine"),
        (Unprintable(), "Unprintable: its message raises TypeError"),
        (MemoryError("x" * 10_000), "MemoryError: xxx"),
        (PluginTimeout("injected"), "took too long: injected"),
    ],
)
def test_whatever_a_plugin_raises_is_its_fault(error: BaseException, told: str) -> None:
    guard = PluginGuard()
    guard.starting = False
    guard.time = 1.5
    with interruptible():
        fail(guard, "behavior mine", error)
    [fault] = guard.faults
    assert (fault.time, fault.plugin, fault.count) == (1.5, "behavior mine", 1)
    assert fault.error.startswith(told)
    assert len(fault.error) < 400


def test_the_users_interrupt_is_not_a_fault() -> None:
    guard = PluginGuard()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with interruptible(), pytest.raises(KeyboardInterrupt):
            guard.call("flow mine", os.kill, os.getpid(), signal.SIGINT, check=nothing)
    finally:
        signal.signal(signal.SIGINT, before)
    with pytest.raises(KeyboardInterrupt):  # outside of a run it cannot be told from the user's
        guard.call("flow mine", raiser(KeyboardInterrupt()), check=nothing)
    assert guard.faults == ()


def test_an_error_in_place_of_the_users_interrupt_is_not_a_fault() -> None:
    """Compiled code may answer the KeyboardInterrupt of a signal with another exception."""

    def disguised() -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None

    guard = PluginGuard()
    with interruptible(), pytest.raises(KeyboardInterrupt):
        guard.call("flow mine", disguised, check=nothing)
    assert guard.faults == ()


def test_a_plugin_may_refuse_the_mission_at_its_start_only() -> None:
    guard = PluginGuard()
    refusal = InputError("no route")
    with pytest.raises(InputError, match="no route"):
        guard.call("planner mine", raiser(refusal), check=nothing)
    guard.starting = False
    fail(guard, "planner mine", refusal)
    told = guard.faults[0].error
    assert re.fullmatch(
        r"InputError: no route \(.*test_guard_plugin_guard\.py:\d+, in call: raise error\)", told
    )


def test_answers_are_checked_and_errors_counted_by_kind() -> None:
    guard = PluginGuard()

    def speed(answer: Any) -> float:
        return number(answer, "speed", 0.0, 2.0)

    assert guard.call("controller mine", lambda: 1, check=speed) == 1.0
    for answer in ("fast", 3.0, 3.0, float("nan"), 1j, True):
        with pytest.raises(PluginCallError):
            guard.call("controller mine", lambda answer=answer: answer, check=speed)
    assert [fault.count for fault in guard.faults] == [1, 2, 1, 1, 1]
    assert str(guard.faults[1]).endswith("speed 3 is not in [0, 2] (2 times, first at 0.0 s)")


def test_faults_are_bounded() -> None:
    guard = PluginGuard()
    for number_ in range(120):
        fail(guard, "behavior mine", ValueError(str(number_)))
    assert len(guard.faults) == 100


def test_a_vital_stage_fails_from_its_first_failure_until_it_answers() -> None:
    guard = PluginGuard()
    for at in (1.0, 2.0):
        guard.time = at
        fail(guard, "flow mine", ValueError("a"), vital=True)
    fail(guard, "behavior mine", ValueError("b"))
    assert {name: stage.since for name, stage in guard.failing.items()} == {"flow mine": 1.0}
    guard.call("flow mine", lambda: 1, check=nothing, vital=True)
    assert guard.failing == {}


def test_a_time_out_suspends_the_plugin_for_longer_each_time() -> None:
    guard, durations = PluginGuard(limit=0.1, first_limit=0.1), []
    for turn in range(8):
        fail(guard, "behavior slow", PluginTimeout("late"))
        began = guard.time
        while True:
            try:
                guard.call("behavior slow", lambda: 1, check=nothing)
                break
            except PluginCallError:
                guard.time += 0.1
        durations.append(guard.time - began)
        assert guard.faults[0].count == turn + 1, "a suspended plugin is not called"
    first = SUSPENSION
    assert durations[:3] == pytest.approx([first, 2 * first, 4 * first], abs=0.11)
    assert durations[-1] == pytest.approx(MAX_SUSPENSION, abs=0.11)


def test_a_call_that_hangs_is_ended_and_the_next_one_gets_its_own_time() -> None:
    guard = PluginGuard(limit=0.3, first_limit=0.6)
    began = time.monotonic()
    with guard.watchdog.on_duty(), pytest.raises(PluginCallError, match=r"within 0.6 s"):
        guard.call("fusion slow", time.sleep, 30.0, check=nothing)
    with guard.watchdog.on_duty():
        guard.call("fusion quick", time.sleep, 0.4, check=nothing)
        guard.call("fusion quick", time.sleep, 0.4, check=nothing)  # kernels of another function
        guard.starting = False
        with pytest.raises(PluginCallError, match=r"within 0.3 s"):
            guard.call("fusion quick", time.sleep, 30.0, check=nothing)
    assert time.monotonic() - began < 5.0


# --- the watchdog: calls that hang are ended, and the process's own timer is kept -----------------


def test_between_two_calls_nothing_is_limited() -> None:
    watchdog = Watchdog()
    with watchdog.on_duty():
        watchdog.begin(0.1)
        watchdog.end()
        time.sleep(0.6)


def test_a_timer_set_before_goes_on() -> None:
    rung: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda number, _: rung.append(number))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with Watchdog().on_duty():
            pass
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.3
        time.sleep(0.4)
        assert rung == [signal.SIGALRM]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_in_other_threads_no_call_is_limited() -> None:
    def work() -> str:
        watchdog = Watchdog()
        with watchdog.on_duty():
            watchdog.begin(0.01)
            time.sleep(0.4)
        return "done"

    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(work).result() == "done"


def _kernel(x: float) -> float:
    total = 0.0
    for k in range(10):
        total += x**k if x > k else x * k
    return total


def test_compiling_a_kernel_does_not_count() -> None:
    began = time.monotonic()
    watchdog = Watchdog()
    with watchdog.on_duty():
        watchdog.begin(3.0 * PERIOD)  # the alarm may ring between two kernels, once or twice
        while time.monotonic() < began + 8 * PERIOD:
            numba.njit(_kernel)(1.0)  # type: ignore[type-var]
        watchdog.end()


@pytest.mark.parametrize(("waits", "is_ended"), [(1.0, False), (0.5, False), (0.0, True)])
def test_waiting_for_a_processor_does_not_count(
    waits: float, is_ended: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``waits``: the share of the time in which others have all processors."""
    began, guard = time.monotonic(), PluginGuard(first_limit=0.6)
    reader = "navfw.process.watchdog.processor_wait"
    monkeypatch.setattr(reader, lambda: waits * (time.monotonic() - began))
    ended = pytest.raises(PluginCallError, match=r"within 0.6 s") if is_ended else nullcontext()
    with guard.watchdog.on_duty(), ended:
        guard.call("planner slow", time.sleep, 1.1, check=nothing)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts it")
def test_the_time_in_which_others_have_the_processor_is_known() -> None:
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as other:
            began, waited = time.monotonic(), processor_wait()
            while time.monotonic() < began + 0.6:
                pass
            waited = processor_wait() - waited
            other.kill()
    finally:
        os.sched_setaffinity(0, cores)
    assert 0.1 < waited < time.monotonic() - began


@pytest.mark.thorough
def test_while_the_process_is_stopped_no_time_passes_for_a_call() -> None:
    program = """
import time
from navfw.process.watchdog import PluginTimeout, Watchdog
watchdog = Watchdog()
with watchdog.on_duty():
    watchdog.begin(4.0)
    print("begun", flush=True)
    began = time.process_time()
    while time.process_time() < began + 0.1:
        pass
    watchdog.end()
    print("ended", flush=True)
"""
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:  # noqa: S603 - our own text
        assert process.stdout is not None
        assert process.stdout.readline() == b"begun\n"
        process.send_signal(signal.SIGSTOP)
        time.sleep(6.0)
        process.send_signal(signal.SIGCONT)
        assert process.stdout.readline() == b"ended\n"
    assert process.returncode == 0
