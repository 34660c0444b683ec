"""Side views: images to the left and right of the camera's image."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from navfw.robot import CameraModel, RobotModel, SideViews
from navfw.signals import Frame, Pose
from navfw.sim import BoxSpec, CameraFault, CylinderSpec, SensorParams, Simulation, WorldSpec

WORLD = WorldSpec(
    name="hall",
    x=(-6, 6),
    y=(-6, 6),
    boxes=(BoxSpec(name="crate", at=(0.4, 2.0), size=(1, 1, 0.5)),),
    cylinders=(CylinderSpec(name="column", at=(1.2, -1.5), radius=0.3),),
)
# the camera is above the axle: turning the robot does not translate it
WIDE = RobotModel(camera=CameraModel(mount_forward=0.0), side_views=SideViews())
PERFECT = SensorParams.preset("perfect")


def first_frame(robot: RobotModel, yaw: float, sensors: SensorParams = PERFECT) -> Frame:
    with Simulation(WORLD, robot, Pose(0.0, 0.0, yaw), 0, sensors) as sim:
        frame = sim.read().frame
    assert frame is not None
    return frame


def test_a_robot_without_side_views_has_none() -> None:
    assert RobotModel().side_cameras == ()
    assert RobotModel().seen_aside == pytest.approx(math.radians(45.0))
    assert first_frame(RobotModel(), 0.0).sides == ()


def test_side_views_overlap_the_image_and_extend_to_the_specified_angle() -> None:
    left, right = WIDE.side_cameras
    assert left.turn == -right.turn > 0.0
    inner = left.turn - 0.5 * left.hfov
    assert inner == pytest.approx(0.5 * WIDE.camera.hfov - math.radians(5.0))
    assert WIDE.seen_aside == pytest.approx(left.turn + 0.5 * left.hfov)
    assert left.focal == pytest.approx(WIDE.camera.focal)
    assert left.height == WIDE.camera.height


@pytest.mark.parametrize("bearing", [0.75, 1.1, 1.5, -0.9])
def test_bearings_project_as_the_side_cameras_turn(bearing: float) -> None:
    camera = WIDE.side_cameras[0 if bearing > 0.0 else 1]
    base = np.array([math.cos(bearing), math.sin(bearing), 0.0])
    x, y, z = camera.base_from_camera.T @ base
    assert y == pytest.approx(0.0)
    assert math.atan2(-x, z) == pytest.approx(bearing - camera.turn)


@pytest.mark.parametrize("side", [0, 1])
def test_side_view_equals_the_image_of_a_turned_camera(side: int) -> None:
    camera = WIDE.side_cameras[side]
    plain = CameraModel.model_validate(camera.model_dump(exclude={"turn"}))
    turned = first_frame(WIDE.with_camera(plain), camera.turn).image
    seen = first_frame(WIDE, 0.0).sides[side]
    assert seen.shape == turned.shape == (camera.height, camera.width)
    # the wheels settle a little differently under a robot that stands turned
    assert np.mean(np.abs(seen.astype(float) - turned.astype(float))) < 2.0
    assert np.std(seen) > 10.0


def test_side_views_have_the_noise_and_faults_of_the_camera() -> None:
    noisy = first_frame(WIDE, 0.0, PERFECT.model_copy(update={"image_noise": 3.0}))
    clean = first_frame(WIDE, 0.0)
    for one, other in zip((noisy.image, *noisy.sides), (clean.image, *clean.sides), strict=True):
        assert 1.0 < np.std(one.astype(float) - other.astype(float)) < 5.0
    with Simulation(WORLD, WIDE, Pose(0.0, 0.0, 0.0), 0, PERFECT) as sim:
        sim.begin(CameraFault(black=True))
        frame = sim.read().frame
    assert frame is not None
    assert not any(image.any() for image in (frame.image, *frame.sides))


def test_side_views_do_not_change_the_image() -> None:
    alone = first_frame(WIDE.with_camera(WIDE.camera), 0.3)
    assert np.array_equal(alone.image, first_frame(WIDE, 0.3).image)


def test_side_views_are_limited_in_angle() -> None:
    with pytest.raises(ValidationError, match=r"side views reach \d+ degrees"):
        RobotModel(side_views=SideViews(width=400))
