"""What plugins change in the process is told and set back; what libraries do is not."""

from __future__ import annotations

import os
import random
import threading
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from navfw.missions import ProcessState
from navfw.safety import SafetyMonitor


@pytest.fixture(autouse=True)
def _set_back() -> Iterator[None]:
    before = ProcessState.capture()
    with warnings.catch_warnings():
        yield
    before.restore()


CHANGES: dict[str, Callable[[Path], object]] = {
    "the working folder was changed": os.chdir,
    "the environment was changed": lambda folder: os.environ.update({"NAVFW_X": str(folder)}),
    "random's global generator was used": lambda folder: random.random(),  # noqa: S311
    "numpy's global generator was used": lambda folder: np.random.rand(3),  # noqa: NPY002
    "the filters of warnings were changed": lambda folder: warnings.simplefilter("ignore"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_change_is_told_and_set_back(tmp_path: Path, what: str) -> None:
    before = ProcessState.capture()
    assert before.changes() == []
    CHANGES[what](tmp_path)
    assert before.changes() == [what]
    before.restore()
    assert before.changes() == []
    assert before.changed_code() == ""


def test_threads_left_running_are_counted() -> None:
    before = ProcessState.capture()
    over = threading.Event()
    threads = [threading.Thread(target=over.wait) for _ in range(2)]
    for thread in threads:
        thread.start()
    assert before.changes() == ["2 threads left running"]
    over.set()
    for thread in threads:
        thread.join()
    assert before.changes() == []


def test_filters_for_a_library_s_own_category_are_no_change() -> None:
    class OwnWarning(UserWarning):
        """Of a library."""

    before = ProcessState.capture()
    warnings.simplefilter("always", OwnWarning)
    assert before.changes() == []


def test_replaced_functions_of_navfw_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    before = ProcessState.capture()
    with monkeypatch.context() as patch:
        patch.setattr(SafetyMonitor, "limit", lambda self, twist, time, pose: twist)
        assert before.changed_code() == "navfw.safety.monitor.SafetyMonitor.limit"
    assert before.changed_code() == ""
    body = SafetyMonitor.update.__code__
    monkeypatch.setattr(SafetyMonitor.update, "__code__", SafetyMonitor.reset.__code__)
    assert before.changed_code() == "navfw.safety.monitor.SafetyMonitor.update"
    assert SafetyMonitor.update.__code__ is not body
