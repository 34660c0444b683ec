"""Behaviours that hang are ended, rest, and are asked again; nothing waits for them."""

from __future__ import annotations

import signal
import threading
import time

import pytest

from navfw.mofis.watchdog import LONGEST_REST, REST, BehaviorTimeout, Watchdog, time_limit


def hang() -> None:
    while True:
        try:
            time.sleep(0.01)
        except Exception:  # noqa: S112 - as a careless behaviour would
            continue


def test_what_hangs_is_ended_even_if_it_swallows_all_exceptions() -> None:
    begun = time.monotonic()
    with pytest.raises(BehaviorTimeout, match=r"no answer within 0.2 s"), time_limit(0.2):
        hang()
    assert time.monotonic() - begun < 2.0


def test_what_answers_in_time_is_left_alone() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with time_limit(5.0):
        pass
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_another_s_timer_goes_on() -> None:
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


def test_in_other_threads_nothing_is_limited_and_nothing_breaks() -> None:
    done: list[bool] = []

    def work() -> None:
        with time_limit(0.01):
            time.sleep(0.05)
        done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]


def test_who_gave_no_answer_rests_longer_each_time() -> None:
    dog = Watchdog()
    now, rests = 0.0, []
    for _ in range(8):
        assert dog.admits("slow", now)
        assert dog.admits("sound", now)
        with pytest.raises(BehaviorTimeout), dog.watching("slow", now):
            raise BehaviorTimeout("late")
        rest = 0.0
        while not dog.admits("slow", now + rest):
            rest += 0.1
        rests.append(rest)
        now += rest
    assert rests[:3] == pytest.approx([REST, 2 * REST, 4 * REST], abs=0.11)
    assert rests[-1] == pytest.approx(LONGEST_REST, abs=0.11)
    dog.reset()
    assert dog.admits("slow", now)


def test_one_alarm_serves_many_questions() -> None:
    dog = Watchdog(patience=0.2, first=0.2)
    with dog.on_duty():
        with dog.watching("sound", 0.0):
            pass
        for _ in range(2):
            with pytest.raises(BehaviorTimeout, match=r"within 0.2 s"), dog.watching("slow", 0.0):
                time.sleep(5.0)
        time.sleep(0.3)  # between two questions nobody is hurried
    assert dog.admits("sound", 0.0)
    assert not dog.admits("slow", 0.0)
