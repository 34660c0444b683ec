"""The command grid, whose sets and layers make proposals, and what a behaviour knows beside it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from behavior_samples import scene
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from navfw.context import CommandGrid, CommandGridParams, peak
from navfw.robot import RobotModel
from navfw.signals import Pose, Waypoint

GRID = CommandGrid(RobotModel())
SPEED = st.floats(float(GRID.relative_v[0]), 1.0)
TURN = st.floats(-1.0, 1.0)


@given(SPEED, TURN)
def test_around_a_command_is_the_nearest_of_the_grid_and_its_neighbours(
    speed: float, turn: float
) -> None:
    layer = GRID.around(speed, turn)
    assert layer.shape == GRID.shape
    row, column = np.unravel_index(layer.argmax(), layer.shape)
    assert layer[row, column] >= (2.0 / 3.0) ** 2 - 1e-9
    speeds, turns = np.abs(GRID.relative_v - speed), np.abs(GRID.relative_w - turn)
    assert speeds[row] == pytest.approx(speeds.min())
    assert turns[column] == pytest.approx(turns.min())
    far = 1.5 * np.diff(GRID.relative_w).max()
    assert not layer[:, turns > far + 1e-9].any()


@given(TURN, st.floats(0.51, 4.0))
def test_a_peak_falls_to_nothing_that_many_steps_off(value: float, steps: float) -> None:
    values = GRID.relative_w
    set_ = peak(value, values, steps)
    off = np.abs(values - value) / np.diff(values).max()
    assert set_ == pytest.approx(np.maximum(0.0, 1.0 - off / steps))
    assert set_.max() > 0.0


@given(TURN, st.floats(0.1, 1.0))
def test_on_the_spot_is_at_no_speed_and_about_the_turn(turn: float, width: float) -> None:
    layer = GRID.on_the_spot(turn, width)
    assert not layer[GRID.v != 0.0].any()
    (row,) = layer[GRID.v == 0.0]
    assert row == pytest.approx(GRID.turning(turn, width))
    assert not row[np.abs(GRID.relative_w - turn) >= width].any()
    off = np.abs(GRID.relative_w - turn)
    assert off[row.argmax()] == pytest.approx(off.min())


def test_forward_is_all_that_drives_forward() -> None:
    layer = GRID.forward()
    assert (layer[GRID.v > 0.0] == 1.0).all()
    assert not layer[GRID.v <= 0.0].any()
    assert (GRID.v > 0.0).any()
    assert (GRID.v < 0.0).any()


@given(st.floats(0.1, 2.0))
def test_fast_robots_have_more_speeds_so_that_the_lowest_stays_low(cruise: float) -> None:
    speeds = CommandGrid(RobotModel(max_v=2.0), CommandGridParams(cruise=cruise)).v
    forward = speeds[speeds >= 0.0]
    assert len(forward) >= 9
    assert np.diff(forward).max() <= 0.0625 + 1e-9
    with pytest.raises(ValidationError, match="forward"):
        CommandGridParams(forward=3)
    four = CommandGrid(RobotModel(max_v=2.0), CommandGridParams(cruise=cruise, forward=4)).v
    assert np.count_nonzero(four >= 0.0) == 4


OPEN = scene()


def test_only_a_door_that_is_the_waypoint_has_a_distance() -> None:
    there = {"x": OPEN.pose.x + 0.6, "y": 0.8, "tolerance": 0.3, "place": "there", "final": False}
    door = replace(OPEN, waypoint=Waypoint(**there, kind="door"))  # type: ignore[arg-type]
    assert door.door_distance == pytest.approx(1.0)
    room = replace(OPEN, waypoint=Waypoint(**there, kind="room"))  # type: ignore[arg-type]
    assert room.waypoint_distance == pytest.approx(1.0)
    assert room.door_distance == math.inf
    assert replace(OPEN, waypoint=None).door_distance == math.inf


def test_the_way_is_barred_if_the_local_goal_is_not_reachable() -> None:
    assert OPEN.local_goal is not None
    assert not replace(OPEN, local_goal=replace(OPEN.local_goal, reachable=True)).barred
    assert replace(OPEN, local_goal=replace(OPEN.local_goal, reachable=False)).barred
    assert not replace(OPEN, local_goal=None).barred


@given(st.floats(-math.pi, math.pi), st.floats(-3.1, 3.1))
def test_turns_are_the_shorter_way_round(heading: float, turn: float) -> None:
    context = replace(OPEN, pose=Pose(1.0, 2.0, heading))
    assert context.turn_to(heading + turn) == pytest.approx(turn)
    assert context.turn_to(heading + turn + 2.0 * math.pi) == pytest.approx(turn)
