"""``navfw run``, also with --gui, and ``navfw bench loop`` as subprocesses."""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import cv2
import pytest
from cli_calls import PROGRAM, answer, put_file, sole_refusal
from killing import Started
from processes import python

from navfw.errors import InputError
from navfw.missions import prepare
from navfw.missions.run_drawing import WindowOverlay
from navfw.recording import palette, read_result
from navfw.sim.engine import Point3, SimulatorWindow, check_display

SHORT = ["run", "paper-room", "through-the-door", "--seed", "5", "--set", "mission.timeout=3"]
KEYS = """
    outcome reason world mission seed sim_time_s wall_time_s real_time_factor path_length_m
    shortest_path_m spl collisions min_clearance_m distance_to_goal_m estimate_error_m command_hash
    run_folder
"""


def test_a_run_answers_with_its_result_and_keeps_it_in_its_folder(tmp_path: Path) -> None:
    put_file(tmp_path, "runs/paper-room-through-the-door-5/result.json", "{}")
    done = python(PROGRAM, *SHORT, "--json", cwd=tmp_path)
    assert done.returncode == 1, done.stderr  # 3 s are too short: a run that fails
    assert "m to go" in done.stderr
    answer = json.loads(done.stdout)
    assert answer["run_folder"] == "runs/paper-room-through-the-door-5-2"
    assert [key for key in KEYS.split() if key not in answer] == []
    assert (answer["outcome"], answer["collisions"]) == ("timeout", 0)
    place = (answer["world"], answer["mission"], answer["seed"])
    assert place == ("paper-room", "through-the-door", 5)
    assert answer["sim_time_s"] == pytest.approx(3.0, abs=0.05)
    folder = tmp_path / answer["run_folder"]
    result = json.loads((folder / "result.json").read_text())
    assert result["command_hash"] == answer["command_hash"]
    assert result["config"]["mission"]["timeout"] == 3
    assert result["config"]["stack"]["behaviors"]
    assert result["versions"]["pybullet"]
    assert result["overrides"] == ["mission.timeout=3"]
    assert cv2.imread(str(folder / "trajectory.png")) is not None


@pytest.mark.thorough
def test_ctrl_c_ends_as_cancelled_with_the_folder_intact(tmp_path: Path) -> None:
    words = ("run", "paper-room", "through-the-door", "--json", "--out", "new/mine")
    started = Started(PROGRAM, words, tmp_path)
    while "m to go" not in (tmp_path / "stderr").read_text():
        assert started.after(0.02), "it ended before it began"
    started.send(signal.SIGINT, group=False)
    ended = started.ended()
    assert (ended.code, json.loads(ended.stdout)["outcome"]) == (130, "cancelled")
    assert read_result(tmp_path / "new" / "mine")["outcome"] == "cancelled"
    assert [entry.name for entry in (tmp_path / "new").iterdir()] == ["mine"]


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
    words: list[str], message: str, workdir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    (workdir / "file.txt").write_text("text")
    (workdir / "mine").mkdir()
    (workdir / "mine" / "notes.txt").write_text("text")
    assert message in sole_refusal(*words)
    assert sorted(p.name for p in workdir.rglob("*")) == ["file.txt", "mine", "notes.txt"]


def test_bench_gives_ratio_speed_and_memory(capfd: pytest.CaptureFixture[str]) -> None:
    words = ["bench", "loop", "--world", "empty", "--mission", "straight"]
    measured = answer(*words, "--seconds", "2", "--repeats", "2")
    stages = measured["stage_ms"]
    # PyBullet's renderer alone may take longer than the loop with navfw's own
    assert measured["loop_over_render"] > 0.0
    assert measured["loop_wall_s"] > measured["own_render_physics_wall_s"] > 0.0
    # 2 s at 10 frames a second; PyBullet's renderer draws the same images more slowly
    added = 1e-3 * 20 * (measured["pybullet_render_ms"] - stages["render"])
    wall = measured["own_render_physics_wall_s"] + added
    assert measured["render_physics_wall_s"] == pytest.approx(wall, rel=0.3)
    assert added > 0.0
    factor = measured["sim_time_s"] / measured["loop_wall_s"]
    assert measured["real_time_factor"] == pytest.approx(factor, rel=0.5)
    for ratio in ("loop_over_render", "loop_over_own_render"):
        low, high = measured["spread"][ratio]
        assert low <= measured[ratio] <= high
    assert 50 < measured["peak_memory_mb"] < 4000
    assert {"render", "physics", "flow", "perception", "motion"} <= set(stages)


class WindowOnPaper(SimulatorWindow):
    """Keeps what it would show."""

    def __init__(self) -> None:
        self.seen_from: list[tuple[float, float]] = []
        self.lines: dict[str, tuple[list[Point3], tuple[int, int, int]]] = {}
        self.trail: list[tuple[Point3, Point3, tuple[int, int, int]]] = []

    def follow(self, x: float, y: float) -> None:
        self.seen_from.append((x, y))

    def say(self, text: str) -> None:
        self.said = text

    def draw(self, name: str, points: Sequence[Point3], color: tuple[int, int, int]) -> None:
        self.lines[name] = (list(points), color)

    def extend(self, start: Point3, end: Point3, color: tuple[int, int, int]) -> None:
        self.trail.append((start, end, color))


def test_the_overlay_has_the_path_the_way_and_the_local_goal() -> None:
    session = prepare("paper-room", "through-the-door", seed=5, overrides=["mission.timeout=6"])
    window = WindowOnPaper()
    log = session.run(WindowOverlay(window, session.stack).draw).log
    # once per camera frame, where the robot truly is
    at_frames = log.true[:, :2].tolist()
    assert len(window.seen_from) == pytest.approx(10.0 * log.time[-1], rel=0.1)
    assert all(list(point) in at_frames for point in window.seen_from)
    assert re.match(r"[56]\.\d s  \w+: .+", window.said)
    # the path in one piece, in the leaders' colours
    assert all(a[1] == b[0] for a, b in pairwise(window.trail))
    assert math.dist(window.trail[-1][1][:2], at_frames[-1]) < 0.15
    colors = {color for *_, color in window.trail}
    assert colors <= {palette.rgb(palette.behavior_color(name)) for name in log.leaders}
    assert palette.rgb(palette.behavior_color("go_to_xy")) in colors
    way = session.stack.state.path
    assert [point[:2] for point in window.lines["way"][0]] == [(w.x, w.y) for w in way]
    for number, waypoint in enumerate(way):
        low, high = window.lines[f"post {number}"][0]
        assert low[:2] == high[:2] == (waypoint.x, waypoint.y)
        assert low[2] < high[2]
    robot, goal = window.lines["local goal"][0]
    assert 0.1 < math.dist(robot, goal) < 1.0
    low, high = window.lines["local goal post"][0]
    assert low == goal
    assert low[2] < high[2]


@pytest.mark.slow
def test_the_window_changes_no_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("no Xvfb; install the package xvfb")
    reading, writing = os.pipe()
    options = ["-displayfd", str(writing), "-screen", "0", "1024x768x24", "-nolisten", "tcp"]
    options += ["-fbdir", str(tmp_path)]
    process = subprocess.Popen(  # noqa: S603 - the server of this machine
        [server, *options], pass_fds=(writing,), stderr=subprocess.DEVNULL
    )
    os.close(writing)
    with os.fdopen(reading) as number:
        monkeypatch.setenv("DISPLAY", f":{number.readline().strip()}")
    started = Started(PROGRAM, ("run", "empty", "straight", "--gui", "--json"), tmp_path)
    pictures = set()
    while started.after(0.5):
        pictures.add((tmp_path / "Xvfb_screen0").read_bytes())
    ended = json.loads(started.ended().stdout)
    process.terminate()
    process.wait(20)
    assert ended["command_hash"] == prepare("empty", "straight").run().log.command_hash
    assert len(pictures) > 3, "the window shows a robot that drives"


def test_a_display_that_cannot_be_opened_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":4094")
    with pytest.raises(InputError, match=r"--gui: (the display ':4094' cannot|needs the library)"):
        check_display()
