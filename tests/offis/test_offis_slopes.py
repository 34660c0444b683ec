from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from offis_scenes import Scene, grid_points, wall_ahead

from navfw.offis.geometry import GridGeometry
from navfw.offis.slopes import fit_planes, slopes_of_fits
from navfw.robot import CameraModel, RobotModel


def fits_of(scene, pitch=0.0, upward_only=True):
    robot = RobotModel(camera=CameraModel(pitch=pitch))
    points = grid_points(robot.camera)
    geometry = GridGeometry.of(points, 2, robot, 2.0, 2.2)
    nearness = 1.0 / scene.depth(points, robot.camera)
    weight = geometry.upward if upward_only else np.ones_like(geometry.upward)
    return fit_planes(
        geometry, nearness.ravel(), weight.ravel().astype(float), np.full(nearness.size, 0.01)
    )


@given(angle=st.floats(-0.7, 0.7), distance=st.floats(0.5, 4.0), pitch=st.floats(-0.25, 0.25))
@settings(max_examples=40, deadline=None)
def test_the_fit_finds_the_angle_and_distance_of_a_wall(angle, distance, pitch):
    fits = fits_of(
        Scene((replace(wall_ahead(distance, angle, half=1e3), low=-99.0, high=99.0),), floor=None),
        pitch,
    )
    np.testing.assert_allclose(fits.incline, [angle, -angle] * 2, atol=1e-3)
    np.testing.assert_allclose(fits.centre, 1.0 / distance, rtol=1e-3)


@pytest.mark.parametrize(
    ("degrees", "left", "right"),
    [
        (0.0, "[1 1]", "[1 1]"),
        (35.0, "[2 1]", "[2 1]"),
        (75.0, "[3 1]", "[3 1]"),
        (-35.0, "[1 2]", "[1 2]"),
        (-75.0, "[1 3]", "[1 3]"),
    ],
)
def test_all_five_codes(degrees, left, right):
    # one endless plane shows both halves the same code: the larger digit is the nearer side
    angle = math.radians(degrees)
    geometry = GridGeometry.of(grid_points(CameraModel()), 2, RobotModel(), 2.0, 2.2)
    across = np.where(np.arange(192) % 16 < 8, 1.0, -1.0) * geometry.across
    nearness = math.sin(angle) * across + math.cos(angle) * geometry.ahead
    fits = fit_planes(geometry, nearness, np.ones(192), np.full(192, 0.01))
    assert slopes_of_fits(fits).codes == (left, right)


def test_an_outlier_does_not_turn_the_plane():
    geometry = GridGeometry.of(grid_points(CameraModel()), 2, RobotModel(), 2.0, 2.2)
    nearness = np.full(192, 0.5)
    nearness[[0, 17, 33]] = 5.0
    fits = fit_planes(geometry, nearness, np.ones(192), np.full(192, 0.02))
    assert abs(fits.incline[0]) < math.radians(35.0)
    plain = np.linalg.lstsq(
        np.stack([geometry.across, geometry.ahead], 1)[geometry.planes[0] > 0],
        nearness[geometry.planes[0] > 0],
        rcond=None,
    )[0]
    assert abs(fits.incline[0]) < 0.7 * abs(math.atan2(*plain))


def test_no_cells_no_support():
    geometry = GridGeometry.of(grid_points(CameraModel()), 2, RobotModel(), 2.0, 2.2)
    fits = fit_planes(geometry, np.ones(192), np.zeros(192), np.ones(192))
    assert (fits.support == 0.0).all()
    assert slopes_of_fits(fits).codes == ("unknown", "unknown")
