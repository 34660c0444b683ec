"""``navfw run --gui``: the window follows the robot, with path and way; the run is the same."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.errors import InputError
from navfw.missions import WindowOverlay, prepare
from navfw.recording import palette
from navfw.sim import Point3, SimulatorWindow, check_display

_FIELDS = 25
"""Number of fields of the header of an X window dump, of four bytes each."""
_COLOR_BYTES = 12
"""Size of an entry of its table of colours."""


@dataclass(frozen=True, slots=True)
class VirtualDisplay:
    """The display ``name``, for ``DISPLAY``; its picture is in ``file``, an X window dump."""

    name: str
    file: Path

    def picture(self) -> npt.NDArray[np.uint8]:
        """What is shown now: (height, width, 3), red, green, blue."""
        content = self.file.read_bytes()
        header = np.frombuffer(content, dtype=">u4", count=_FIELDS).astype(int)
        size, width, height, line, colors = header[[0, 4, 5, 12, 19]].tolist()
        pixels = np.frombuffer(content, dtype=np.uint8, offset=size + _COLOR_BYTES * colors)
        rows = pixels[: height * line].reshape(height, line // 4, 4)
        return rows[:, :width, 2::-1].copy()


@contextmanager
def virtual_display(folder: Path) -> Iterator[VirtualDisplay]:
    """A display of 1024 x 768 whose picture is kept in ``folder``; skips without Xvfb."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("no Xvfb; install the package xvfb")
    reading, writing = os.pipe()
    options = ["-displayfd", str(writing), "-screen", "0", "1024x768x24", "-nolisten", "tcp"]
    process = subprocess.Popen(  # noqa: S603 - the server of this machine
        [server, *options, "-fbdir", str(folder)], pass_fds=(writing,), stderr=subprocess.DEVNULL
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as number:
            name = f":{number.readline().strip()}"
        yield VirtualDisplay(name, folder / "Xvfb_screen0")
    finally:
        process.terminate()
        process.wait(20)


RUN = ("run", "empty", "straight")
NAVFW = [sys.executable, "-c", "from navfw.cli import main; main()"]


def pixels_of(picture: npt.NDArray[np.uint8], color: str) -> int:
    """The number of pixels in nearly that colour."""
    away = np.abs(picture.astype(int) - np.array(palette.rgb(color))).max(axis=2)
    return int((away < 12).sum())


class WindowOnPaper(SimulatorWindow):
    """Keeps what it would show."""

    def __init__(self) -> None:
        self.seen_from: list[tuple[float, float]] = []
        self.lines: dict[str, tuple[list[Point3], tuple[int, int, int]]] = {}
        self.trail: list[tuple[Point3, Point3, tuple[int, int, int]]] = []

    def follow(self, x: float, y: float) -> None:
        self.seen_from.append((x, y))

    def draw(self, name: str, points: Sequence[Point3], color: tuple[int, int, int]) -> None:
        self.lines[name] = (list(points), color)

    def extend(self, start: Point3, end: Point3, color: tuple[int, int, int]) -> None:
        self.trail.append((start, end, color))


def test_the_overlay_has_the_path_the_way_and_the_local_goal() -> None:
    session = prepare("paper-room", "through-the-door", seed=5, overrides=["mission.timeout=6"])
    window = WindowOnPaper()
    log = session.run(observers=[WindowOverlay(window, session.stack)]).run.log
    # once per camera frame, where the robot truly is
    at_frames = log.true[:, :2].tolist()
    assert len(window.seen_from) == pytest.approx(10.0 * log.time[-1], rel=0.1)
    assert all(list(point) in at_frames for point in window.seen_from)
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
def test_the_window_shows_robot_path_and_way_and_changes_no_command(tmp_path: Path) -> None:
    plain = CliRunner().invoke(app, [*RUN, "--json", "--out", str(tmp_path / "plain")])
    path, way, goal = palette.behavior_color("go_to_xy"), palette.GOAL, palette.LOCAL_GOAL
    shown = []
    command = [*NAVFW, *RUN, "--gui", "--json", "--out", str(tmp_path / "gui")]
    with virtual_display(tmp_path) as display:
        environment = {**os.environ, "DISPLAY": display.name}
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)  # noqa: S603
        with process:
            while process.poll() is None:
                time.sleep(0.05)
                picture = display.picture()
                if min(pixels_of(picture, color) for color in (path, way, goal)) > 10:
                    shown.append(picture)
            assert process.stdout is not None
            answer = json.loads(process.stdout.read())
    assert answer["command_hash"] == json.loads(plain.stdout)["command_hash"]
    assert shown, "path, way ahead and local goal are seen"
    height, width, _ = shown[-1].shape
    # the camera follows: the robot's body is in the middle
    body = shown[-1][height // 2 - 40 : height // 2 + 40, width // 2 - 40 : width // 2 + 40]
    blue = (body[..., 2] > 90) & (body[..., 2] > 2 * body[..., 0].astype(int))
    assert blue.sum() > 100


def test_a_display_that_cannot_be_opened_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":4094")
    with pytest.raises(InputError, match=r"--gui: (the display ':4094' cannot|needs the library)"):
        check_display()
