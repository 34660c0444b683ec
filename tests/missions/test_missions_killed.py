"""``navfw run`` under kill -9, SIGTERM and Ctrl-C at seeded moments.

``NAVFW_KILLS=20 uv run pytest -m slow tests/missions/test_missions_killed.py`` takes 20 moments.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest
from killing import Ended, Started, moments

from navfw.process import scratch_folder
from navfw.recording import FILES, RunFolder, read_result

MANY = int(os.environ.get("NAVFW_KILLS", "5"))
"""Moments for each signal in the slow test."""

PRINTED_BY_C = re.compile(
    r"""Traceback [^\n]*\n  File "[^"]*", line \d+, in _watched_import\n"""
    r"""(?:  [^\n]*\n)*KeyboardInterrupt: SIG"""
)
"""Compiled code that imports prints an interruption where it cannot raise it."""

WORDS = ("run", "empty", "straight", "--set", "mission.timeout=1", "--record", "--json", "--quiet")

MAIN = """
from navfw.cli import main
main()
"""

MARKED = (
    """
from pathlib import Path
from navfw.recording.run_folder import RunFolder
enter = RunFolder.__enter__
def enter_and_tell(self):
    Path("loaded").touch()  # the mission is loaded: from here on there has to be a result
    return enter(self)
RunFolder.__enter__ = enter_and_tell
"""
    + MAIN
)


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[float, dict[str, Any]]:
    """Wall time [s] and result of an undisturbed run, the kernels compiled."""
    folder = tmp_path_factory.mktemp("usual")
    began = time.monotonic()
    ended = Started(MAIN, (*WORDS, "--out", "o"), folder).ended()
    assert ended.code == 1, ended.stderr
    return time.monotonic() - began, json.loads(ended.stdout)


def hidden(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir() if file.name.startswith(".")}


def check_interrupted(ended: Ended, folder: Path, hash_of_all: str) -> None:
    """There is one valid result, printed and written, if the mission had been loaded."""
    assert not hidden(folder)
    if (folder / "loaded").exists():  # else Python may have been importing
        printed_by_c = len(PRINTED_BY_C.findall(ended.stderr))
        ignored = ended.stderr.count("Exception ignored")
        assert ended.stderr.count("Traceback") == ignored + printed_by_c
    if not ended.stdout:
        assert not (folder / "loaded").exists(), ended.stderr
        assert not (folder / "o").exists()
        assert ended.code != 0
        return
    printed = json.loads(ended.stdout)
    assert printed["outcome"] in {"cancelled", "timeout"}
    assert printed["outcome"] == "cancelled" or printed["command_hash"] == hash_of_all
    assert ended.code == (3 if "is missing" in ended.stderr else 1)
    result = read_result(folder / "o")
    assert {key: result[key] for key in printed if key != "run_folder"} == {
        key: value for key, value in printed.items() if key != "run_folder"
    }


def check_killed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There is nothing half-written, and the next start removes what lies beside."""
    if (folder / "o").exists():
        assert read_result(folder / "o")["outcome"] in {"timeout", "cancelled", "fault"}
        assert {file.name for file in (folder / "o").iterdir()} <= FILES
    with monkeypatch.context() as patch, RunFolder(folder / "next"):
        patch.setattr(tempfile, "tempdir", str(folder / "tmp"))
        with scratch_folder("next"):
            pass
        assert hidden(folder) == {".next.navfw-lock", ".next.navfw-part"}
    assert not hidden(folder / "tmp")


def kill_runs(
    number: signal.Signals,
    count: int,
    usual: tuple[float, dict[str, Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    longest, result = usual
    for index, moment in enumerate(moments(number, count, longest)):
        folder = tmp_path / f"{index}"
        folder.mkdir()
        started = Started(MARKED, (*WORDS, "--out", "o"), folder)
        if started.after(moment):
            if number is signal.SIGKILL:
                kill(started, index)
            else:
                started.send(number)
        ended = started.ended()
        if number is signal.SIGKILL:
            check_killed(folder, monkeypatch)
        else:
            check_interrupted(ended, folder, result["command_hash"])
        shutil.rmtree(folder)


def kill(started: Started, index: int) -> None:
    """Kill both processes of the run, the one that drives, and the one that waits, in turn."""
    driving = started.children()
    if index % 3 == 1 and driving:
        with contextlib.suppress(ProcessLookupError):
            os.kill(driving[0], signal.SIGKILL)
    else:
        started.send(signal.SIGKILL, group=index % 3 == 0)


@pytest.mark.parametrize(("words", "code"), [(("list", "worlds"), 0), (WORDS, 1)])
def test_a_signal_after_the_end_changes_nothing(
    words: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    at_exit = "import atexit, os, signal\natexit.register(os.kill, os.getpid(), signal.SIGINT)\n"
    ended = Started(at_exit + MAIN, words, tmp_path).ended()
    assert ended.code == code
    assert ended.stderr == ""


SIGNALS = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT]


@pytest.mark.thorough
@pytest.mark.parametrize("number", SIGNALS)
def test_a_killed_run_leaves_a_result_or_nothing(
    number: signal.Signals,
    usual: tuple[float, dict[str, Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kill_runs(number, 2, usual, tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS)
def test_a_run_killed_at_many_moments_leaves_a_result_or_nothing(
    number: signal.Signals,
    usual: tuple[float, dict[str, Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kill_runs(number, MANY, usual, tmp_path, monkeypatch)
