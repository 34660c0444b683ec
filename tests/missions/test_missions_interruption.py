"""Interruption by signals; what plugins change in the process is told and set back."""

import builtins
import math
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from navfw.process import ProcessState, check_interrupted, deferred, interrupted, interruptible
from navfw.safety import SafetyMonitor


@pytest.fixture(autouse=True)
def _usual_handlers() -> Iterator[None]:
    """The handlers of an interactive process, whatever pytest was started with."""
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


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


# --- changes of the process ----------------------------------------------------------------------


@pytest.fixture(autouse=True)
def _set_back() -> Iterator[None]:
    before = ProcessState()
    with warnings.catch_warnings():
        yield
    before.restore()


CHANGES: dict[str, Callable[[Path], object]] = {
    "the working folder was changed": os.chdir,
    "the environment was changed": lambda folder: os.environ.update({"NAVFW_X": str(folder)}),
    "numpy's global generator was used": lambda folder: np.random.rand(3),  # noqa: NPY002
    "the filters of warnings were changed": lambda folder: warnings.simplefilter("ignore"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_change_is_told_and_set_back(tmp_path: Path, what: str) -> None:
    before = ProcessState()
    assert before.changes() == []
    CHANGES[what](tmp_path)
    assert before.changes() == [what]
    before.restore()
    assert before.changes() == []
    assert before.code.restore() == ""


def test_threads_left_running_are_counted() -> None:
    before = ProcessState()
    over = threading.Event()
    with ThreadPoolExecutor(2) as threads:
        for _ in range(2):
            threads.submit(over.wait, 9.0)
        assert before.changes() == ["2 threads left running"]
        over.set()
    assert before.changes() == []


def test_filters_for_a_library_s_own_category_or_text_are_no_change() -> None:
    class OwnWarning(UserWarning):
        """Of a library."""

    before = ProcessState()
    warnings.simplefilter("always", OwnWarning)
    warnings.filterwarnings("ignore", message="its own text")
    assert before.changes() == []


def test_replaced_functions_are_named_and_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    before = ProcessState().code
    limit, body = SafetyMonitor.limit, SafetyMonitor.update.__code__
    monkeypatch.setattr(SafetyMonitor, "limit", lambda self, twist, time, pose: twist)
    monkeypatch.setattr(SafetyMonitor.update, "__code__", SafetyMonitor.reset.__code__)
    monkeypatch.setattr(math, "hypot", max)
    monkeypatch.setattr(builtins, "sorted", None)
    names = before.restore()
    assert names.startswith("builtins.sorted, navfw.safety.monitor.SafetyMonitor.")
    assert names.endswith(" and 1 more")
    assert (SafetyMonitor.limit, SafetyMonitor.update.__code__) == (limit, body)
    assert math.hypot(3.0, 4.0) == 5.0
    assert sorted("ba") == ["a", "b"]
    assert before.restore() == ""
