"""The picture of a run: the path by leading behaviour, and what moved."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from picture_colors import share_of

from navfw.missions import MissionResult, prepare
from navfw.missions.run_report import draw_trajectory
from navfw.numerics import Array
from navfw.recording.palette import CONTACT, FLOOR, FURNITURE, MOVING, WALL, behavior_color, rgb
from navfw.recording.run_observers import Contact, RunLogger
from navfw.signals import Pose, Twist, Waypoint
from navfw.sim.world_changes import WalkerTrack


@pytest.fixture(scope="module")
def result() -> MissionResult:
    """A curve of 5 s on which two behaviours lead."""
    driven = prepare("office", "lobby-to-lab", overrides=["mission.timeout=0.1"]).run()
    logger = RunLogger()
    for tick in range(300):
        at = Pose(1.2 + 0.01 * tick, 1.2 + 0.5 * np.sin(0.02 * tick), 0.0)
        estimate = Pose(at.x, at.y + 0.001 * tick, 0.0)
        leader = "avoid" if 100 <= tick < 200 else "go_to_xy"
        logger.add(tick / 60, at, estimate, Twist(0.3, 0.0), leader, tick == 7)
    logger.add_waypoints((Waypoint(2.0, 1.0, 0.3, "door", "door", False),))
    logger.contacts.append(Contact(5.0, 4.2, 1.2, "column"))
    return replace(driven, log=logger.log())


def drawn(path: Path, result: MissionResult) -> Array:
    draw_trajectory(result, path)
    image = cv2.imread(str(path))
    assert image is not None
    return image[:, :, ::-1].astype(np.float64)


def test_the_path_has_the_colours_of_the_leading_behaviours(
    result: MissionResult, tmp_path: Path
) -> None:
    image = drawn(tmp_path / "a.png", result)
    assert min(image.shape[:2]) > 400
    led = behavior_color("go_to_xy"), behavior_color("avoid")
    for color in (*led, WALL, FURNITURE, CONTACT):
        assert share_of(image, color) > 1e-5, color
    # the picture of an empty log has none of the leaders' colours
    bare = drawn(tmp_path / "b.png", replace(result, log=RunLogger().log()))
    assert share_of(bare, led[1]) < 1e-6
    # the same run gives the same picture
    draw_trajectory(result, tmp_path / "c.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "c.png").read_bytes()


def test_moving_obstacles_are_drawn_where_they_went(result: MissionResult, tmp_path: Path) -> None:
    went = np.column_stack([np.linspace(2.0, 5.0, 50), np.full(50, 2.4)])[:, None]
    movers = WalkerTrack(("anna",), np.array([0.2]), np.linspace(0.0, 5.0, 50), went)
    shown = drawn(tmp_path / "a.png", replace(result, movers=movers))
    bare = drawn(tmp_path / "b.png", result)
    # seven tenths of the colour over the floor
    parts = [0.7 * a + 0.3 * b for a, b in zip(rgb(MOVING), rgb(FLOOR), strict=True)]
    mixed = "#" + "".join(f"{round(part):02X}" for part in parts)
    assert share_of(shown, mixed) > 1e-4 > share_of(bare, mixed)
