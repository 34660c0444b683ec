"""Progress lines of a run on stderr."""

import io
import signal
import sys
import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest
import rich.progress
import typer

from navfw.cli import progress_bar, run
from navfw.cli.progress_bar import ProgressBar
from navfw.process.interruption import interruptible


def terminal_in(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """A terminal of 120 columns in place of stderr, on which bars are drawn at once."""
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress_bar, "REFRESH_PERIOD", 0.0)
    return terminal


def test_the_line_of_a_run_ends_with_the_last_clause_that_fits() -> None:
    tick: Any = SimpleNamespace(
        time=1.0,
        true_pose=(0.0, 0.0, 0.0),
        state=SimpleNamespace(path=(SimpleNamespace(place="hall"),)),
        leader="avoid",
        percept=SimpleNamespace(sentence="Front is a door;   Floor"),
    )
    goal: Any = SimpleNamespace(x=3.0, y=0.0)
    short = "  1.0 s,  3.0 m to go, 0.5 x real time: avoid to hall"
    assert run._line(tick, goal, 0.5, 60) == short
    assert run._line(tick, goal, 0.5, 200) == f"{short}; Front is a door; Floor"


def test_a_bar_without_a_terminal_is_lines_with_rate_and_time_left(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter([10.0, 12.0, 30.0, 50.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    with ProgressBar("checking", "worlds") as bar:
        bar.update(2, 10, "first")
        bar.update(3, 10, "within the period")
        bar.update(5, 10, "third")
        bar.update(10, 10)
    out, err = capfd.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "checking: 2 of 10 worlds: first",
        "checking: 5 of 10 worlds, 0.1/s, 33 s left: third",
        "checking: 10 of 10 worlds, 0.2/s",
    ]


def test_each_part_of_the_work_has_its_own_rate(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter([0.0, 100.0, 160.0, 280.0, 300.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    with ProgressBar("reproduce") as bar:
        bar.show_part("times")
        bar.show_part("views", 0, 100)
        bar.show_part("views", 1, 100)
        bar.show_part("views", 100, 100)
        bar.show_part("pictures")
    assert capfd.readouterr().err.splitlines() == [
        "reproduce: times",
        "reproduce: views: 0 of 100",
        "reproduce: views: 1 of 100, 1/min, 1 h 39 min left",
        "reproduce: views: 100 of 100, 0.6/s",
        "reproduce: pictures",
    ]


def test_lines_of_a_file_stay_in_it_while_a_bar_is_shown(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = terminal_in(monkeypatch)
    with ProgressBar("perceive", "images") as bar:
        bar.update(0, 2)
        typer.echo("a result")
    assert capfd.readouterr().out == "a result\n"
    assert "a result" not in screen.getvalue()


def test_a_bar_shows_nothing_before_the_first_update_and_nothing_when_quiet(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with ProgressBar("checking", "worlds"):
        pass
    with ProgressBar("checking", "worlds", quiet=True) as bar:
        bar.update(1, 2)
    assert capfd.readouterr() == ("", "")


def test_a_bar_on_a_terminal_shows_names_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = terminal_in(monkeypatch)
    with ProgressBar("compiling", "kernels") as bar:
        bar.update(0, 4, "array [m]")
        bar.update(1, 4, "sweep_arcs")
    for text in ("0 of 4 kernels", "array [m]", "1 of 4 kernels, ", " s left"):
        assert text in screen.getvalue()


def _wait_for(screen: io.StringIO, text: str) -> None:
    """Until the bar on ``screen`` shows ``text``; fails after 10 s."""
    end = time.monotonic() + 10.0
    while text not in screen.getvalue():
        assert time.monotonic() < end, f"{text} is not in {screen.getvalue()!r}"
        time.sleep(0.01)


def test_a_moving_bar_shows_the_time_elapsed_between_updates(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    screen = terminal_in(monkeypatch)
    monkeypatch.setattr(progress_bar, "MOVES_PER_SECOND", 50.0)
    clock = [100.0]
    monkeypatch.setattr(progress_bar, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    threads = threading.active_count()
    with ProgressBar("rooms", "runs", moving=True) as bar:
        bar.update(0, 5)
        _wait_for(screen, "0:00:01")  # the first run is not over yet
        assert "left" not in screen.getvalue()
        clock[0] = 110.0
        bar.update(1, 5)
        _wait_for(screen, "1 of 5 runs, 0.1/s, 40 s left")
    while threading.active_count() > threads:  # the thread that draws ends soon
        time.sleep(0.01)


def test_ctrl_c_as_a_bar_appears_shows_the_cursor(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = terminal_in(monkeypatch)
    start = rich.progress.Progress.start

    def start_and_interrupt(bar: rich.progress.Progress) -> None:
        start(bar)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(rich.progress.Progress, "start", start_and_interrupt)
    with pytest.raises(KeyboardInterrupt), interruptible(), ProgressBar("work") as bar:
        bar.update(0, 2)
    assert screen.getvalue().rindex("\x1b[?25h") > screen.getvalue().rindex("\x1b[?25l")
