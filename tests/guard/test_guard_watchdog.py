"""The watchdog: plugin calls that hang are ended, and the process's own timer is kept."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator

import numba
import pytest

from navfw.process import (
    GRACE,
    HEARTBEAT_SIZE,
    MAX_GAP,
    PERIOD,
    HeartbeatMonitor,
    PluginTimeout,
    Watchdog,
    begin_call,
    end_call,
    postpone,
    set_memory,
)


def hang() -> None:
    """Never return, and catch every exception."""
    while True:
        try:
            time.sleep(0.01)
        except Exception:  # noqa: S112 - as a plugin might
            continue


def test_a_call_that_hangs_is_ended_even_if_it_catches_all_exceptions() -> None:
    watchdog, begun = Watchdog(), time.monotonic()
    with pytest.raises(PluginTimeout, match=r"no result within 0.2 s"), watchdog.on_duty():
        watchdog.begin("behavior slow", 0.2)
        hang()
    assert time.monotonic() - begun < 2.0


def test_between_two_calls_nothing_is_limited() -> None:
    watchdog = Watchdog()
    with watchdog.on_duty():
        watchdog.begin("behavior correct", 0.1)
        watchdog.end()
        time.sleep(0.6)


def test_the_timer_is_left_as_it_was() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with Watchdog().on_duty():
        assert signal.getitimer(signal.ITIMER_REAL)[1] > 0.0
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


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
    done: list[bool] = []

    def work() -> None:
        watchdog = Watchdog()
        with watchdog.on_duty():
            watchdog.begin("behavior slow", 0.01)
            time.sleep(0.4)
        done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]


def _kernel(x: float) -> float:
    total = 0.0
    for k in range(10):
        total += x**k if x > k else x * k
    return total


def test_compiling_a_kernel_does_not_count() -> None:
    began = time.monotonic()
    watchdog = Watchdog()
    with watchdog.on_duty():
        watchdog.begin("behavior compiling", 0.2)
        while time.monotonic() < began + 4 * PERIOD:  # the alarm rings meanwhile
            numba.njit(_kernel)(1.0)  # type: ignore[type-var]
        watchdog.end()


def test_while_the_process_is_stopped_no_time_passes_for_a_call() -> None:
    program = """
import time
from navfw.process.watchdog import PluginTimeout, Watchdog
watchdog = Watchdog()
with watchdog.on_duty():
    watchdog.begin("behavior paused", 3.0)
    print("begun", flush=True)
    began = time.process_time()
    while time.process_time() < began + 0.5:
        pass
    watchdog.end()
    print("ended", flush=True)
"""
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:  # noqa: S603 - our own text
        assert process.stdout is not None
        assert process.stdout.readline() == b"begun\n"
        process.send_signal(signal.SIGSTOP)
        time.sleep(4.0)
        process.send_signal(signal.SIGCONT)
        assert process.stdout.readline() == b"ended\n"
    assert process.returncode == 0


@pytest.fixture
def heartbeat() -> Iterator[HeartbeatMonitor]:
    """The supervisor's side of this process' heartbeat."""
    memory = bytearray(HEARTBEAT_SIZE)
    set_memory(memory)
    yield HeartbeatMonitor(memory)
    set_memory(None)


def test_the_supervisor_reads_the_call_in_progress_and_the_last_one(
    heartbeat: HeartbeatMonitor,
) -> None:
    begin_call("flow mine", 17.0)
    assert heartbeat.plugin == heartbeat.last_call == "flow mine"
    begin_call("é" * 200, 17.0)
    assert heartbeat.plugin.startswith("é" * 50)
    begin_call("fusion short", 17.0)
    end_call()
    assert (heartbeat.plugin, heartbeat.last_call) == ("", "fusion short")
    assert not any(heartbeat.overdue(1e6 + 0.2 * k) for k in range(100))


def _first_overdue(heartbeat: HeartbeatMonitor, times: Iterable[float]) -> float:
    return next((now for now in times if heartbeat.overdue(now)), math.inf)


def test_a_call_is_overdue_when_it_has_been_late_for_the_grace_period(
    heartbeat: HeartbeatMonitor,
) -> None:
    looks = [0.2 * k for k in range(200)]
    begin_call("flow mine", 10.0)
    assert _first_overdue(heartbeat, looks) == pytest.approx(10.0 + GRACE, abs=0.5)
    begin_call("flow mine", 10.0)
    postpone(7.0)
    assert _first_overdue(heartbeat, looks) == pytest.approx(17.0 + GRACE, abs=0.5)


def test_a_pause_of_the_supervisor_does_not_make_a_call_overdue(
    heartbeat: HeartbeatMonitor,
) -> None:
    begin_call("flow mine", 10.0)
    assert not heartbeat.overdue(9.9)
    assert not heartbeat.overdue(1000.0), "both were stopped: the call had no time either"
    begin_call("flow mine", 1000.4)
    assert not heartbeat.overdue(1000.2)
    assert not heartbeat.overdue(1003.0)
    begin_call("flow mine", 1002.0)
    looks = [1003.0 + 0.2 * k for k in range(1, 100)]
    assert _first_overdue(heartbeat, looks) > 1003.0 + GRACE - MAX_GAP - 0.1
