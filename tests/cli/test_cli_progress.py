"""Progress lines of a run on stderr."""

from __future__ import annotations

import time

import pytest

from navfw.cli import run
from navfw.missions.runner import Progress


def progress(seconds: float) -> Progress:
    return Progress(seconds, 2.0 * seconds, 3.0, "avoid", "Front is a door;   Floor", "hall")


def test_without_a_terminal_there_is_a_line_every_few_seconds(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with run._ProgressLine(quiet=False) as line:
        line.show(progress(1.0))
        line.show(progress(2.0))
        monkeypatch.setattr(run, "LINE_PERIOD", -1.0)
        line._next_line = 0.0
        line.show(progress(3.0))
    out, err = capfd.readouterr()
    assert out == ""
    assert [text.split(" s ")[0].strip() for text in err.splitlines()] == ["1.0", "3.0"]
    assert "3.0 m to go   0.5x  avoid > hall" in err
    assert "Front is a door; Floor" in err


def test_a_long_delay_is_explained_once(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "COMPILING_NOTICE_AFTER", 0.05)
    with run._ProgressLine(quiet=False) as line:
        line.show(progress(1.0))
        text = ""
        while run.COMPILING not in text:
            time.sleep(0.01)
            text += capfd.readouterr().err
        time.sleep(0.2)
    assert capfd.readouterr().err == ""


def test_quiet_prints_nothing(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "COMPILING_NOTICE_AFTER", 0.01)
    with run._ProgressLine(quiet=True) as line:
        line.show(progress(1.0))
        time.sleep(0.1)
    assert capfd.readouterr() == ("", "")
