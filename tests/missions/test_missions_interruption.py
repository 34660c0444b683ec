"""Interruption by signals: raised, deferred, and never lost."""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from navfw.process.interruption import check_interrupted, deferred, interruptible


@pytest.fixture(autouse=True)
def _usual_handlers() -> Iterator[None]:
    """The handlers of an interactive process, whatever pytest was started with."""
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def interrupted() -> bool:
    """Whether a KeyboardInterrupt is taken for one that the user has sent."""
    try:
        check_interrupted(KeyboardInterrupt())
    except KeyboardInterrupt:
        return True
    return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_interrupts_and_is_told_from_a_raised_interrupt(number: signal.Signals) -> None:
    with interruptible():
        with pytest.raises(KeyboardInterrupt):
            raise KeyboardInterrupt
        assert not interrupted()
        with pytest.raises(KeyboardInterrupt, match=number.name):
            os.kill(os.getpid(), number)
        assert interrupted()
    assert interrupted(), "outside of a run"


def test_handlers_are_restored_and_an_ignored_signal_stays_ignored() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    before = signal.getsignal(signal.SIGINT)
    with interruptible():
        assert signal.getsignal(signal.SIGINT) is not before
        os.kill(os.getpid(), signal.SIGTERM)
        assert not interrupted()
    assert signal.getsignal(signal.SIGINT) is before


def test_a_thread_other_than_the_main_one_changes_no_handler() -> None:
    def work() -> object:
        with interruptible():
            return signal.getsignal(signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(work).result() is before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_deferred_signal_waits_for_the_end_or_for_an_interruptible_part(
    number: signal.Signals,
) -> None:
    steps: list[str] = []
    with pytest.raises(KeyboardInterrupt, match=number.name), interruptible():
        with deferred():
            os.kill(os.getpid(), number)
            steps.append("deferred")
        steps.append("after")
    with deferred():
        os.kill(os.getpid(), number)
        with pytest.raises(KeyboardInterrupt, match=number.name), interruptible():
            steps.append("interruptible")
        with deferred():
            steps.append("once only")
    assert steps == ["deferred", "once only"]


def test_an_exit_is_not_replaced_by_a_signal_that_waits() -> None:
    with pytest.raises(SystemExit), deferred():
        os.kill(os.getpid(), signal.SIGTERM)
        raise SystemExit(3)
    with pytest.raises(KeyboardInterrupt), deferred():
        os.kill(os.getpid(), signal.SIGTERM)
    with interruptible():
        assert not interrupted()


def test_a_signal_may_come_at_any_moment_of_a_deferred_part() -> None:
    """Both modes alternate under signals: none is lost, none arrives in a deferred part."""
    caught, broken = 0, 0
    for _ in range(200):
        try:
            with interruptible(), deferred():
                try:
                    os.kill(os.getpid(), signal.SIGTERM)
                    sum(range(50))
                except KeyboardInterrupt:
                    broken += 1
        except KeyboardInterrupt:
            caught += 1
    assert (caught, broken) == (200, 0)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_signal_that_python_drops_in_a_finalizer_is_not_lost() -> None:
    class Finalized:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            sum(range(50))

    with interruptible():
        check_interrupted()
        Finalized()  # its KeyboardInterrupt is dropped
        with pytest.raises(KeyboardInterrupt):
            check_interrupted()
