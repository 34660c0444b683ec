"""Low things on textured floor: seen in time, not seen where there are none, remembered."""

import math
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from cli_calls import answer
from flow_scene import Board, board_image
from localization_drives import odometry
from localmap_samples import grid_with

from navfw.localmap import OccupancyGrid
from navfw.movers.low_things import LowThings
from navfw.numerics import Array, Mask
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, Pose
from navfw.worldgen import generate

ROBOT = RobotModel()
RADIUS, CAMERA_AHEAD = ROBOT.radius, ROBOT.camera.mount_forward


def driven(
    *boards: Board,
    to: float,
    turn: float = 0.0,
    step: float = 0.05,
    slip: float = 1.0,
    robot: RobotModel = ROBOT,
    light: float = 0.0,
) -> tuple[OccupancyGrid, list[Array]]:
    """The grid, and what was found, of a drive from x = 0 to ``to`` [m] by the wheels' odometry.

    The robot turns by ``turn`` [rad] per step, its wheels count ``slip`` times the way, and each
    image is brighter by ``light`` [grey levels] than the one before.
    """
    search, grid, found = LowThings(robot), OccupancyGrid(robot), []
    noise = np.random.default_rng(3)
    pose, wheels = Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0)
    for k in range(round(to / step) + 1):
        image = board_image(robot.camera, pose, boards=boards) + light * k
        grey = np.clip(image + noise.normal(0.0, 2.0, image.shape), 0, 255).astype(np.uint8)
        grid.update(wheels, 0.1 * k)
        low = search.search(Frame(0.1 * k, grey), odometry(wheels, 0.1 * k, 10.0 * step))
        if low is not None:
            found.append(low)
            grid.integrate_low(low, wheels)
        pose = pose.compose(Pose(step * math.cos(0.5 * turn), step * math.sin(0.5 * turn), turn))
        way = step * slip
        wheels = wheels.compose(Pose(way * math.cos(0.5 * turn), way * math.sin(0.5 * turn), turn))
    return grid, found


def occupied_at(grid: OccupancyGrid) -> Array:
    """Places (n, 2) [m, odom] of the occupied cells."""
    rows, columns = np.nonzero(grid.occupied)
    cell = grid.params.cell
    return np.column_stack([columns * cell, rows * cell]) + np.array(grid.origin, np.float64)


def around(places: Array, x: float, y: float, reach: float) -> Mask:
    return np.asarray(np.hypot(places[:, 0] - x, places[:, 1] - y) < reach)


@pytest.mark.parametrize("height", [0.08, 0.1])
@pytest.mark.parametrize("slip", [0.98, 1.0, 1.02])
def test_a_low_thing_is_seen_at_braking_distance(height: float, slip: float) -> None:
    thing = Board(1.5, 0.02, width=0.12, height=height)
    # its rim 0.35 m before the thing
    places = occupied_at(driven(thing, to=1.5 - RADIUS - 0.35, slip=slip)[0])
    assert around(places, 1.5 * slip, thing.y, 0.1).any()
    assert around(places, 1.5 * slip, thing.y, 0.2).all()


@pytest.mark.parametrize("turn", [-0.03, 0.0, 0.03])
@pytest.mark.parametrize("light", [0.0, 1.5])
def test_floor_is_floor(turn: float, light: float) -> None:
    grid, found = driven(to=2.0, turn=turn, light=light)
    assert not grid.occupied.any()
    assert len(found) > 10
    assert np.median(np.concatenate(found)[:, 2]) == -0.6


def test_a_thing_is_remembered_once_it_has_left_the_view() -> None:
    grid, _ = driven(Board(1.2, 0.25, width=0.15, height=0.08), to=1.2)
    assert around(occupied_at(grid), 1.2, 0.25, 0.12).any()


def test_a_robot_that_stands_or_reverses_searches_nothing() -> None:
    assert driven(to=1.0, step=-0.05)[1] == []
    search = LowThings(ROBOT)
    image = board_image(ROBOT.camera, Pose(0.0, 0.0, 0.0))
    for k in range(5):
        frame = Frame(0.1 * k, np.asarray(image, dtype=np.uint8))
        assert search.search(frame, odometry(Pose(0.0, 0.0, 0.0), 0.1 * k)) is None


@pytest.mark.parametrize(
    "camera",
    [
        CameraModel(mount_height=0.2, pitch=0.3),
        CameraModel(width=320, height=240, hfov=1.1, mount_height=1.0, pitch=0.5),
        CameraModel(pitch=-0.9),
        CameraModel(pitch=0.5, hfov=2.0),
    ],
    ids=["low", "high", "upwards", "wide"],
)
def test_any_camera_finds_floor_or_nothing(camera: CameraModel) -> None:
    grid, _ = driven(to=2.0, robot=ROBOT.model_copy(update={"camera": camera}))
    assert not grid.occupied.any()


def test_one_image_is_not_enough_and_floor_seen_again_frees() -> None:
    grid = OccupancyGrid(ROBOT)
    here = Pose(0.3, -0.2, 0.4)
    grid.update(here, 0.0)
    thing = np.array([[0.6, 0.1, 1.2], [0.61, 0.1, -0.6]])
    cell = grid.index(*here.to_parent(0.6, 0.1))
    grid.integrate_low(thing, here)
    assert not grid.occupied.any()
    grid.integrate_low(thing, here)
    assert grid.occupied[cell]
    # what is around it too, until floor was seen there
    assert grid.occupied.sum() == 25
    beside = here.to_local(
        *(np.array(grid.origin) + grid.params.cell * np.array([cell[1] + 1, cell[0]]))
    )
    grid.integrate_low(np.array([[*beside, -0.6]]), here)
    assert grid.occupied.sum() == 24
    for _ in range(3):
        grid.integrate_low(np.array([[0.6, 0.1, -0.6]]), here)
    assert not grid.occupied.any()


def test_the_foot_of_a_pole_does_not_make_it_wider() -> None:
    grid = grid_with((1.0, 1.1, -0.05, 0.05))
    pole = grid.occupied.copy()
    for left in (0.1, -0.1, 0.1, -0.1):
        grid.integrate_low(np.array([[1.05, left, 1.2]]), Pose(0.0, 0.0, 0.0))
    assert (grid.occupied == pole).all()
    for _ in range(2):
        grid.integrate_low(np.array([[1.05, 0.2, 1.2]]), Pose(0.0, 0.0, 0.0))
    assert grid.occupied[grid.index(1.05, 0.2)], "a foot that is wider than the pole"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 3])
def test_the_foot_of_a_table_is_not_touched(seed: int) -> None:
    run = answer("run", "lounge", "--goal", "5.4,4.0", "--seed", seed)
    assert run["outcome"] == "reached"
    assert run["collisions"] == 0


@pytest.mark.thorough
@pytest.mark.parametrize("look", [None, "photo"])
def test_a_thing_2_cm_high_is_not_touched(look: Literal["photo"] | None, tmp_path: Path) -> None:
    folder = generate("clutter", 5, 0.0, look=look).write(tmp_path / "world")
    thing = "{at: 5, obstacle: {ahead: 1.6, size: [0.2, 0.4], height: 0.02, texture: wood}}"
    run = answer("run", folder, "cross", "--seed", 5, "--set", f"mission.events=[{thing}]")
    assert run["outcome"] == "reached"
    assert run["collisions"] == 0
