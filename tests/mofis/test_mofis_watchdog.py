"""The watchdog: behaviours that hang are ended, suspended, and called again later."""

from __future__ import annotations

import signal
import threading
import time

import pytest

from navfw.mofis.watchdog import (
    LONGEST_SUSPENSION,
    SUSPENSION,
    BehaviorTimeout,
    Watchdog,
    time_limit,
)


def hang() -> None:
    """Never return, and catch every exception."""
    while True:
        try:
            time.sleep(0.01)
        except Exception:  # noqa: S112 - as a behaviour might
            continue


def test_a_call_that_hangs_is_ended_even_if_it_catches_all_exceptions() -> None:
    begun = time.monotonic()
    with pytest.raises(BehaviorTimeout, match=r"no result within 0.2 s"), time_limit(0.2):
        hang()
    assert time.monotonic() - begun < 2.0


def test_a_call_that_returns_in_time_leaves_the_timer_as_it_was() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with time_limit(5.0):
        pass
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_timer_set_before_goes_on() -> None:
    rung: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda number, _: rung.append(number))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with time_limit(5.0):
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
        with time_limit(0.01):
            time.sleep(0.05)
        done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]


def test_suspensions_grow_with_every_time_out() -> None:
    watchdog = Watchdog()
    now, durations = 0.0, []
    for _ in range(8):
        assert watchdog.admits("slow", now)
        assert watchdog.admits("correct", now)
        with pytest.raises(BehaviorTimeout), watchdog.watching("slow", now):
            raise BehaviorTimeout("late")
        duration = 0.0
        while not watchdog.admits("slow", now + duration):
            duration += 0.1
        durations.append(duration)
        now += duration
    first = SUSPENSION
    assert durations[:3] == pytest.approx([first, 2 * first, 4 * first], abs=0.11)
    assert durations[-1] == pytest.approx(LONGEST_SUSPENSION, abs=0.11)
    watchdog.reset()
    assert watchdog.admits("slow", now)


def test_one_alarm_serves_many_calls() -> None:
    watchdog = Watchdog(limit=0.2, first_limit=0.2)
    with watchdog.on_duty():
        with watchdog.watching("correct", 0.0):
            pass
        for _ in range(2):
            with (
                pytest.raises(BehaviorTimeout, match=r"within 0.2 s"),
                watchdog.watching("slow", 0.0),
            ):
                time.sleep(5.0)
        time.sleep(0.3)  # between two calls nothing is limited
    assert watchdog.admits("correct", 0.0)
    assert not watchdog.admits("slow", 0.0)
