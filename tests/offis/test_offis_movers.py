"""Movers: vectors that contradict the camera's motion, and where their feet are."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navfw.egomotion.camera_motion import camera_motion
from navfw.flow.derotation import derotate
from navfw.offis.movers import find_movers
from navfw.offis.nearness import triangulate
from navfw.offis.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, FlowField, Pose, Twist

ROBOT = RobotModel()
CAMERA = ROBOT.camera
X, Y = np.meshgrid((np.arange(16) - 7.5) * 10.0, (np.arange(12) - 5.5) * 10.0)
POINTS = np.stack([X, Y], axis=-1)


def wall_flow(motion: CameraMotion, depth: float = 3.0) -> FlowField:
    """Exact flow of a wall, derotated."""
    s = motion.translation
    vectors = (POINTS * s[2] - CAMERA.focal * s[:2]) / (depth + s[2])
    shape = POINTS.shape[:2]
    flow = FlowField(1.0, POINTS, vectors, np.ones(shape), np.full(shape, 0.1), motion, True)
    return dataclasses.replace(flow, contradiction=np.zeros(shape))


def drive(way: float) -> CameraMotion:
    return camera_motion(ROBOT, Pose(0, 0, 0), Pose(way, 0, 0), 0.1)


def with_walker(flow: FlowField, columns: slice, rows: slice, shift: float) -> FlowField:
    """``flow`` with a region that moves sideways by ``shift`` [px] on its own."""
    vectors = flow.vectors.copy()
    vectors[rows, columns, 0] += shift
    return dataclasses.replace(flow, vectors=vectors)


def test_nothing_moves_in_a_world_at_rest() -> None:
    for way in (0.0, 0.04, 0.1):
        percept = Offis(ROBOT).perceive(wall_flow(drive(way)), Twist(0.3, 0.0))
        assert percept.movers == ()
        assert percept.sees_depth == (way > 0.0)


def test_a_standing_camera_sees_whoever_walks_and_where() -> None:
    flow = with_walker(wall_flow(drive(0.0)), slice(10, 13), slice(0, 9), 2.0)
    percept = Offis(ROBOT).perceive(flow, Twist(0.0, 0.0))
    (mover,) = percept.movers
    feet = POINTS[8, 11]
    assert mover.bearing == pytest.approx(-math.atan2(feet[0], CAMERA.focal), abs=0.02)
    depth = CAMERA.mount_height * CAMERA.focal / feet[1]
    assert mover.distance == pytest.approx(depth / math.cos(mover.bearing), rel=0.02)
    assert not percept.sees_depth


def test_flow_toward_the_focus_of_expansion_contradicts_driving_on() -> None:
    # on the right, vectors of things at rest point to the right; a walker's point to the left
    flow = with_walker(wall_flow(drive(0.04)), slice(10, 13), slice(3, 9), -4.0)
    seen = triangulate(flow, CAMERA.focal)
    assert (seen.contradiction[3:9, 10:13] > 0.5).all()
    assert seen.contradiction[:, :9].max() == 0.0
    assert (seen.confidence[3:9, 10:13] == 0.0).all()


def test_few_cells_and_what_hangs_in_the_air_are_no_movers() -> None:
    odd = np.zeros((12, 16))
    odd[7:9, 4] = 1.0
    assert find_movers(POINTS, odd, CAMERA) == ()
    odd[0:4, 10:13] = 1.0
    assert find_movers(POINTS, odd, CAMERA) == ()
    odd[8, 11] = 1.0  # joined to nothing
    assert find_movers(POINTS, odd, CAMERA) == ()


def test_parts_above_each_other_are_one_mover() -> None:
    odd = np.zeros((12, 16))
    odd[0:4, 10:12] = 1.0
    odd[7:9, 10:12] = 1.0  # at the horizon's rows a mover may look like a thing at rest
    (mover,) = find_movers(POINTS, odd, CAMERA)
    assert mover.distance < 2.0


def test_derotation_keeps_what_contradicts() -> None:
    flow = dataclasses.replace(wall_flow(drive(0.04)), derotated=False)
    marked = dataclasses.replace(flow, contradiction=np.full((12, 16), 0.7))
    kept = derotate(marked, CAMERA).contradiction
    assert kept is not None
    assert (kept == 0.7).all()
