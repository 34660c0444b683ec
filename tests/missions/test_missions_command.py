"""``navfw run`` and ``navfw bench loop`` as subprocesses."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.missions import Lap, summarize

NAVFW = [sys.executable, "-c", "from navfw.cli import main; main()"]
SHORT = ["run", "paper-room", "through-the-door", "--seed", "5", "--set", "mission.timeout=3"]
KEYS = [
    "outcome",
    "reason",
    "world",
    "mission",
    "seed",
    "sim_time_s",
    "wall_time_s",
    "real_time_factor",
    "path_length_m",
    "shortest_path_m",
    "spl",
    "collisions",
    "min_clearance_m",
    "distance_to_goal_m",
    "estimate_error_m",
    "command_hash",
    "run_folder",
]


def start(*words: str, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603 - this Python, words of our own
        [*NAVFW, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=300)
    return process.returncode, out, err


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[dict[str, Any], str, Path]]:
    """The same run in two new processes: output, stderr and working folder of each."""
    folder = tmp_path_factory.mktemp("run")
    answers = []
    for _ in range(2):
        code, out, err = finish(start(*SHORT, "--json", folder=folder))
        assert code == 1, err  # 3 s are too short: a run that fails
        answers.append((json.loads(out), err, folder))
    return answers


@pytest.mark.thorough
def test_the_same_seed_gives_the_same_commands_in_fresh_processes(
    twice: list[tuple[dict[str, Any], str, Path]],
) -> None:
    (first, _, _), (second, _, _) = twice
    assert first["command_hash"] == second["command_hash"]
    assert len(first["command_hash"]) == 64
    for key in ("outcome", "path_length_m", "estimate_error_m", "min_clearance_m"):
        assert first[key] == second[key]


def test_the_answer_has_all_keys(twice: list[tuple[dict[str, Any], str, Path]]) -> None:
    answer, progress, _ = twice[0]
    assert [key for key in KEYS if key not in answer] == []
    assert answer["outcome"] == "timeout"
    assert (answer["world"], answer["mission"], answer["seed"]) == (
        "paper-room",
        "through-the-door",
        5,
    )
    assert answer["sim_time_s"] == pytest.approx(3.0, abs=0.05)
    assert answer["collisions"] == 0
    assert "m to go" in progress


def test_the_folders_are_numbered_and_complete(
    twice: list[tuple[dict[str, Any], str, Path]],
) -> None:
    folders = [folder / answer["run_folder"] for answer, _, folder in twice]
    assert [folder.name for folder in folders] == [
        "paper-room-through-the-door-5",
        "paper-room-through-the-door-5-2",
    ]
    assert sorted(p.name for p in folders[0].parent.iterdir()) == [f.name for f in folders]
    for folder, (answer, _, _) in zip(folders, twice, strict=True):
        result = json.loads((folder / "result.json").read_text())
        assert result["command_hash"] == answer["command_hash"]
        assert result["config"]["mission"]["timeout"] == 3
        assert result["config"]["stack"]["behaviors"]
        assert result["versions"]["pybullet"]
        assert result["overrides"] == ["mission.timeout=3"]
        assert cv2.imread(str(folder / "trajectory.png")) is not None


@pytest.mark.thorough
def test_ctrl_c_ends_as_cancelled_with_the_folder_intact(tmp_path: Path) -> None:
    words = ("run", "paper-room", "through-the-door", "--json", "--out", "mine")
    process = start(*words, folder=tmp_path)
    assert process.stderr is not None
    while "m to go" not in process.stderr.readline():
        assert process.poll() is None, "it ended before it began"
    process.send_signal(signal.SIGINT)
    code, out, _ = finish(process)
    answer = json.loads(out)
    assert (code, answer["outcome"]) == (1, "cancelled")
    assert json.loads((tmp_path / "mine" / "result.json").read_text())["outcome"] == "cancelled"
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "ofice", "lobby-to-lab"], "did you mean 'office'?"),
        (["run", "office", "lobby-to-lap"], "did you mean 'lobby-to-lab'?"),
        (["run", "office", "lobby-to-lab", "--stack", "defalt"], "did you mean 'default'?"),
        (["run", "office", "lobby-to-lab", "--set", "offis.layer=1"], "did you mean 'layers'?"),
        (["run", "office", "lobby-to-lab", "--set", "ofis.layers=1"], "did you mean 'offis'?"),
        (["run", "office", "lobby-to-lab", "--set", "offis.layers=many"], "offis.layers"),
        (["run", "office", "lobby-to-lab", "--set", "mission.goals=[labb]"], "did you mean 'lab'?"),
        (["run", "office", "lobby-to-lab", "--set", "mission.start=[5, 3, 0]"], "wall"),
        (["run", "office", "lobby-to-lab", "--set", "robot.camera.width=150"], "150"),
        (["run", "office", "lobby-to-lab", "--set", "nonsense"], "key=value"),
        (["run", "office", "lobby-to-lab", "--out", "file.txt"], "is a file"),
        (["run", "office", "lobby-to-lab", "--out", "mine"], "not a run folder"),
        (["run", "office", "lobby-to-lab", "--seed", "-1"], "--seed"),
        (["run", "office", "lobby-to-lab", "--gui"], "--gui: needs a display"),
        (["replay", "nowhere"], "not a run folder"),
        (["bench", "loop", "--world", "ofice"], "did you mean 'office'?"),
    ],
)
def test_bad_input_gives_one_message_and_leaves_no_files(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    (tmp_path / "file.txt").write_text("text")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("text")
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2, done.output
    assert message in done.stderr
    assert "Traceback" not in done.output
    assert done.stdout == ""
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["file.txt", "mine", "notes.txt"]


def test_bench_gives_ratio_speed_and_memory(capfd: pytest.CaptureFixture[str]) -> None:
    words = ["bench", "loop", "--world", "empty", "--mission", "straight", "--json"]
    done = CliRunner().invoke(app, [*words, "--seconds", "2", "--repeats", "2"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    # PyBullet's renderer alone may take longer than the loop with navfw's own
    assert answer["loop_over_render"] > 0.0
    assert answer["render_physics_wall_s"] > 0.0
    assert answer["loop_wall_s"] > answer["own_render_physics_wall_s"] > 0.0
    # 2 s at 10 frames a second
    spent = answer["own_render_physics_wall_s"] - 1e-3 * 20 * answer["stage_ms"]["render"]
    assert answer["render_physics_wall_s"] == pytest.approx(
        spent + 1e-3 * 20 * answer["pybullet_render_ms"], rel=0.3
    )
    # PyBullet's renderer draws the same images more slowly
    assert answer["pybullet_render_ms"] > answer["stage_ms"]["render"]
    assert answer["real_time_factor"] == pytest.approx(
        answer["sim_time_s"] / answer["loop_wall_s"], rel=0.5
    )
    for ratio in ("loop_over_render", "loop_over_own_render"):
        low, high = answer["spread"][ratio]
        assert low <= answer[ratio] <= high
    assert 50 < answer["peak_memory_mb"] < 4000
    assert {"render", "physics", "flow", "perception", "motion"} <= set(answer["stage_ms"])


def test_bench_reports_medians() -> None:
    laps = [
        Lap(
            sim_time=10.0,
            wall_time=wall,
            render_time=0.15,
            physics_time=0.1,
            frames=100,
            pybullet_frame=0.009,
            stages={"flow": 0.1 * wall},
            outcome="timeout",
        )
        for wall in (2.0, 9.0, 4.0)
    ]
    found = summarize(laps, frame_rate=10.0)
    assert found["render_physics_wall_s"] == pytest.approx(1.0)
    assert found["own_render_physics_wall_s"] == pytest.approx(0.25)
    assert found["pybullet_render_ms"] == pytest.approx(9.0)
    assert found["loop_over_render"] == pytest.approx(4.0)
    assert found["loop_over_own_render"] == pytest.approx(16.0)
    assert found["spread"]["loop_over_own_render"] == pytest.approx([8.0, 36.0])
    assert found["real_time_factor"] == pytest.approx(2.5)
    assert found["spread"]["loop_over_render"] == pytest.approx([2.0, 9.0])
    assert found["stage_ms"]["flow"] == pytest.approx(1e3 * 0.4 / 100)
