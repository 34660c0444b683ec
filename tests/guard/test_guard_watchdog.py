"""The watchdog: plugin calls that hang are ended, and the process's own timer is kept."""

from __future__ import annotations

import signal
import threading
import time

import numba
import pytest

from navfw.heartbeat import HEARTBEAT_SIZE, begin_call, end_call, read_call, set_memory
from navfw.watchdog import PERIOD, PluginTimeout, Watchdog


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
        for _ in range(4):
            numba.njit(_kernel)(1.0)  # type: ignore[type-var]
        watchdog.end()
    assert time.monotonic() - began > 2 * PERIOD, "the alarm did not ring meanwhile"


def test_the_supervisor_reads_the_call_in_progress_and_the_last_one() -> None:
    memory = bytearray(HEARTBEAT_SIZE)
    set_memory(memory)
    try:
        begin_call("flow mine", 17.0)
        now = read_call(memory)
        assert (now.call, now.deadline) == ("flow mine", 17.0)
        assert not now.overdue(18.0)
        assert now.overdue(30.0)
        begin_call("é" * 200, 17.0)
        assert read_call(memory).call.startswith("é" * 50)
        begin_call("fusion short", 17.0)
        end_call()
        assert read_call(memory).call == "fusion short"
        assert not read_call(memory).overdue(1e12)
    finally:
        set_memory(None)
