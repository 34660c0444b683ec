"""A recorded run that is killed leaves what it has recorded, and every command opens it."""

import json
import shutil
import signal
import time
from pathlib import Path

import pytest
from cli_calls import PROGRAM, invoke, output, put_files, refusal
from killing import Started

from navfw.recording import RECORDING, RESULT, RunFolder, read_result
from navfw.recording.run_folder import REPORT
from navfw.recording.run_replay import load_recording

MISSION = """\
map: empty
start: [0, 0, 0]
goals: [{x: 3, y: 0}]
timeout: 60
events: [{at: 0.5, lasting: 0.3, behavior: {name: go_to_xy, does: raises}}]
"""
WORDS = ("run", "empty", "faulty.yaml", "--record", "--quiet")


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that is left of a run with a fault of a behaviour, after ``kill -9``."""
    folder = tmp_path_factory.mktemp("killed")
    put_files(folder, {"faulty.yaml": MISSION})
    started = Started(PROGRAM, (*WORDS, "--out", "o"), folder)
    left = folder / "o-unfinished"
    until = time.monotonic() + 200.0
    while not (left / RECORDING).exists() or (left / RECORDING).stat().st_size < 600_000:
        assert started.running() and time.monotonic() < until, started.ended()
        time.sleep(0.02)
    started.send(signal.SIGKILL, group=True)
    assert started.ended().code == -signal.SIGKILL
    return left


@pytest.fixture
def left(killed: Path, tmp_path: Path) -> Path:
    shutil.copytree(killed, tmp_path / "o-unfinished")
    return tmp_path / "o-unfinished"


def test_a_killed_run_is_found_and_opened(left: Path) -> None:
    assert read_result(left)["outcome"] == "unfinished"
    assert [event["began_s"] for event in read_result(left)["events"]] == [0.5]
    assert f"a run that has not ended is in {left}" in refusal("replay", left.with_name("o"))
    recording = load_recording(left / RECORDING)
    assert not recording.complete
    assert recording.times[-1] > 1.0
    replayed = invoke("replay", left)
    assert replayed.exit_code == 0, replayed.output  # with the fault of the behaviour, to the bit
    assert "the recording ends before its run did" in replayed.stdout
    explained = invoke("explain", left, "--at", 1.5)
    assert "led by" in explained.stdout, explained.output
    assert explained.stderr == "note: the recording ends before its run did\n"
    output("report", left)
    page = (left / REPORT).read_text(encoding="utf-8")
    assert "The recording ends before its run" in page
    assert "unfinished" in page


def test_a_file_that_ends_within_a_chunk_is_opened_to_there(left: Path) -> None:
    file = left / RECORDING
    content, whole = file.read_bytes(), load_recording(left / RECORDING)
    for lost in (1, 40_000, len(content) // 2):
        file.write_bytes(content[:-lost])
        assert invoke("replay", left).exit_code == 0
        assert 0 < len(load_recording(file)) <= len(whole)
    assert len(load_recording(file)) < len(whole)


def test_the_next_run_takes_another_number_and_replaces_what_has_the_name(left: Path) -> None:
    with RunFolder(left.with_name("o"), numbered=True) as folder:
        folder.write_json(RESULT, {})
    assert folder.final == left.with_name("o-2")
    assert left.is_dir()
    words = ("--set", "mission.timeout=0.2", "--record", "--out", left.with_name("o"), "--json")
    done = invoke("run", "empty", "straight", *words)
    assert json.loads(done.stdout)["run_folder"] == str(left.with_name("o"))
    assert sorted(entry.name for entry in left.parent.iterdir()) == ["o", "o-2"]


def test_other_files_at_the_place_of_an_unfinished_run_stay(left: Path) -> None:
    (left / "notes.txt").touch()
    words = ("--record", "--out", left.with_name("o"))
    assert "o-unfinished: is not a run folder" in refusal("run", "empty", "straight", *words)
    assert (left / "notes.txt").is_file()


def test_a_mission_that_is_refused_leaves_nothing(tmp_path: Path) -> None:
    words = ("--goal", "900,900", "--record", "--out", tmp_path / "o")
    assert refusal("run", "empty", *words)
    assert list(tmp_path.iterdir()) == []
