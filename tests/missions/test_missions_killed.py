"""``navfw run`` under kill -9, SIGTERM and Ctrl-C, and on a full disk: the result is never lost.

``NAVFW_KILLS=20 uv run pytest -m slow tests/missions/test_missions_killed.py`` takes 20 moments.
"""

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cli_calls import PROGRAM, invoke
from killing import MANY, Ended, Started, moments

from navfw.missions import MissionResult
from navfw.missions.session import Session
from navfw.process.atomic import scratch_folder
from navfw.recording import RECORDING, RunFolder, read_result, run_observers
from navfw.recording.run_folder import FILES
from navfw.recording.run_replay import load_recording

WORDS = ("run", "empty", "straight", "--set", "mission.timeout=1", "--record", "--quiet")

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
    + PROGRAM
)


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[float, dict[str, Any]]:
    """Wall time [s] and result of an undisturbed run, the kernels compiled."""
    folder = tmp_path_factory.mktemp("usual")
    began = time.monotonic()
    ended = Started(PROGRAM, (*WORDS, "--json", "--out", "o"), folder).ended()
    assert ended.code == 1, ended.stderr
    return time.monotonic() - began, json.loads(ended.stdout)


def hidden(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir() if file.name.startswith(".")}


def check_interrupted(ended: Ended, folder: Path, hash_of_all: str) -> None:
    """There is one valid result, printed and written, if the mission had been loaded."""
    assert not hidden(folder)
    if (folder / "loaded").exists():  # else Python may have been importing
        assert ended.stderr.count("Traceback") == ended.stderr.count("Exception ignored")
    if not ended.stdout:
        assert not (folder / "loaded").exists(), ended.stderr
        assert not (folder / "o").exists()
        assert ended.code != 0
        return
    printed = json.loads(ended.stdout)
    assert printed["outcome"] in {"cancelled", "timeout"}
    assert printed["outcome"] == "cancelled" or printed["command_hash"] == hash_of_all
    usual = 130 if printed["outcome"] == "cancelled" else 1
    assert ended.code == (3 if "is missing" in ended.stderr else usual)
    del printed["run_folder"]
    result = read_result(folder / "o")
    assert {key: result[key] for key in printed} == printed


def check_killed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There is a result or what was recorded, and the next start removes what else lies beside."""
    outcomes = {"o": {"timeout", "cancelled", "fault"}, "o-unfinished": {"unfinished", "timeout"}}
    for left in filter(Path.exists, (folder / name for name in outcomes)):
        assert read_result(left)["outcome"] in outcomes[left.name]
        assert {file.name for file in left.iterdir()} <= FILES
    with monkeypatch.context() as patch, RunFolder(folder / "next"):
        patch.setattr(tempfile, "tempdir", str(folder / "tmp"))
        with scratch_folder("next"):
            pass
        assert hidden(folder) == {".next.navfw-lock", ".next.navfw-part"}
    assert not hidden(folder / "tmp")


def kill(started: Started, index: int) -> None:
    """Kill both processes of the run, the one that drives, and the one that waits, in turn."""
    driving = started.children()
    if index % 3 == 1 and driving:
        with contextlib.suppress(ProcessLookupError):
            os.kill(driving[0], signal.SIGKILL)
    else:
        started.send(signal.SIGKILL, group=index % 3 == 0)


@pytest.mark.parametrize(("words", "code"), [(("list", "worlds"), 0), ((*WORDS, "--json"), 1)])
def test_a_signal_after_the_end_changes_nothing(
    words: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    at_exit = "import atexit, os, signal\natexit.register(os.kill, os.getpid(), signal.SIGINT)\n"
    ended = Started(at_exit + PROGRAM, words, tmp_path).ended()
    assert ended.code == code
    assert ended.stderr == ""


def test_a_run_killed_after_it_has_printed_keeps_its_result(tmp_path: Path) -> None:
    die = "import os, signal\nos._exit = lambda _: os.kill(os.getpid(), signal.SIGKILL)\n"
    ended = Started(die + PROGRAM, (*WORDS, "--json", "--out", "o"), tmp_path).ended()
    assert (json.loads(ended.stdout)["outcome"], ended.code, ended.stderr) == ("timeout", 1, "")
    assert read_result(tmp_path / "o")["outcome"] == "timeout"


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize(
    "count",
    [
        pytest.param(2, marks=pytest.mark.thorough, id="few"),
        pytest.param(MANY, marks=pytest.mark.slow, id="many"),
    ],
)
def test_a_killed_run_leaves_a_result_or_nothing(
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
        started = Started(MARKED, (*WORDS, "--json", "--out", "o"), folder)
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


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[None]:
    """From the end of the drive on, files are limited to ``request.param`` [byte]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    run = Session.run

    def run_then_limit(session: Session, *args: Any, **kwargs: Any) -> MissionResult:
        result = run(session, *args, **kwargs)
        resource.setrlimit(resource.RLIMIT_FSIZE, (request.param, before[1]))
        return result

    monkeypatch.setattr(Session, "run", run_then_limit)
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("limited", [100], indirect=True)
@pytest.mark.usefixtures("limited")
def test_a_result_that_cannot_be_written_is_printed(tmp_path: Path) -> None:
    ended = invoke(*WORDS, "--out", tmp_path / "o", "--json")
    assert ended.exit_code == 3, ended.output
    printed = json.loads(ended.stdout)
    recorded = tmp_path / "o-unfinished"
    assert (printed["outcome"], printed["run_folder"]) == ("timeout", str(recorded))
    lines = ended.stderr.splitlines()
    assert lines[0].endswith("o/result.json: cannot be written: File too large")
    assert lines[1].endswith(f"result.json, run.mcap, stack.yaml in {recorded}")
    assert list(tmp_path.iterdir()) == [recorded]
    assert read_result(recorded)["outcome"] == "unfinished"
    assert load_recording(recorded / RECORDING).complete


@pytest.mark.parametrize("limited", [20_000], indirect=True)
@pytest.mark.usefixtures("limited")
def test_a_file_size_limit_costs_the_picture_only(tmp_path: Path) -> None:
    ended = invoke(*WORDS, "--out", tmp_path / "o")
    assert ended.exit_code == 3, ended.output
    assert ended.stdout.startswith("timeout after")
    assert ended.stderr.splitlines() == [
        "navfw: trajectory.png is missing: File too large",
        "navfw: saved: foxglove_layout.json, map.yaml, result.json, run.mcap, stack.yaml,"
        f" trajectory.tum, truth.tum in {tmp_path / 'o'}",
    ]
    assert read_result(tmp_path / "o")["outcome"] == "timeout"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["o"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 640 KB in memory; skipped where this user must not mount one."""
    place = tmp_path / "small"
    place.mkdir()
    mount, unmount = shutil.which("mount"), shutil.which("umount")
    if mount is None or unmount is None:
        pytest.skip("there is no command mount")
    words = [mount, "-t", "tmpfs", "-o", "size=640k", "navfw-small", str(place)]
    if subprocess.run(words, check=False, capture_output=True).returncode:  # noqa: S603 - our words
        pytest.skip("this user must not mount a tmpfs")
    yield place
    subprocess.run([unmount, str(place)], check=True)  # noqa: S603 - our words


def test_a_full_disk_costs_the_end_of_the_recording(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_observers, "_ROOM", 300_000)  # of the megabyte that it is
    longer = (*WORDS, "--set", "mission.timeout=6", "--out", small_disk / "o", "--json")
    ended = invoke(*longer)
    assert ended.exit_code == 3, ended.output
    assert "run.mcap ends before the run: No space left on device" in ended.stderr
    assert "trajectory.png is missing" not in ended.stderr
    printed = json.loads(ended.stdout)
    assert read_result(small_disk / "o")["command_hash"] == printed["command_hash"]
    recording = load_recording(small_disk / "o" / RECORDING)
    assert not recording.complete
    assert 60 < len(recording) < printed["tick"]
    replayed = invoke("replay", small_disk / "o")
    assert "the recording ends before its run did" in replayed.stdout, replayed.output

    (small_disk / "filler").write_bytes(bytes(resource.getpagesize()))
    with pytest.raises(OSError, match="No space"), (small_disk / "filler").open("ab") as stream:
        while True:
            stream.write(bytes(resource.getpagesize()))
            stream.flush()
    ended = invoke(*WORDS, "--out", small_disk / "full", "--json")  # told before the drive
    assert (ended.exit_code, ended.stdout) == (2, ""), ended.output
    assert "full: cannot be written: No space left on device" in ended.stderr
    assert sorted(file.name for file in small_disk.iterdir()) == ["filler", "o"]
