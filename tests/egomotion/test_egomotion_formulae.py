"""Residuals, costs and projections: values worked out by hand from their formulae."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.egomotion.epipolar_kernels import CAUCHY, rate_directions
from navfw.egomotion.floor_kernels import SLANT, UNKNOWNS, _residuals
from navfw.egomotion.floor_registration import FloorRegistration
from navfw.egomotion.refinement import refine_rotation
from navfw.numerics import Array
from navfw.robot import CameraModel, RobotModel

FOCAL = 80.0
CAMERA = CameraModel(width=64, height=48, pitch=0.3)


def refined(
    points: Array, confidence: float, translation: Array, prior: Array
) -> tuple[Array, Array, Array, Array]:
    """The refinement of points without flow, each with 0.5 px, about yaw and pitch."""
    n, axes = len(points), np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    sure = np.full(n, confidence)
    flow = np.zeros((n, 2))
    settings = 4.0, 0.0, 1.0
    return refine_rotation(
        points, flow, np.full(n, 0.5), sure, translation, FOCAL, axes, prior, settings
    )


@pytest.mark.parametrize("confidence", [0.0, 1.0])
def test_deviations_are_those_of_the_inverse_of_the_information(confidence: float) -> None:
    points = np.array([(40.0, 5.0), (30.0, -30.0), (-50.0, -20.0), (10.0, 40.0)])
    prior, ahead = np.array([0.02, 0.005]), np.array([0.0, 0.0, 0.1])
    _, deviations, _, _ = refined(points, confidence, ahead, prior)
    # turning by yaw and pitch moves a point; across the line from the centre that is its residual
    x, y = points.T / FOCAL
    yaw = FOCAL * np.stack([-(1.0 + x * x), -x * y])
    pitch = FOCAL * np.stack([x * y, 1.0 + y * y])
    across = np.stack([-y, x]) / np.hypot(x, y)
    rows = np.stack([(yaw * across).sum(axis=0), (pitch * across).sum(axis=0)])
    information = np.diag(1.0 / prior**2) + confidence * rows @ rows.T / 0.5**2
    assert deviations == pytest.approx(np.sqrt(np.diag(np.linalg.inv(information))))


@pytest.mark.parametrize("length", [0.05, 3.0])
def test_lines_have_no_direction_within_four_pixels_of_the_focus_of_expansion(
    length: float,
) -> None:
    towards = np.array([0.3, -0.2, 1.0])
    foe, span = FOCAL * towards[:2], 4.0 * float(np.linalg.norm(towards))
    around = foe + span * np.array([(0.98, 0.0), (0.0, -0.98), (1.02, 0.0), (0.0, -1.02)])
    distances = refined(around, 1.0, length * towards, np.array([0.01, 0.01]))[2]
    assert np.isnan(distances).tolist() == [True, True, False, False]


@pytest.mark.parametrize("off", [0.5, 4.0, 30.0])
def test_the_cost_of_a_direction_is_bounded_for_each_vector(off: float) -> None:
    points, weight = np.array([(20.0, 0.0), (0.0, 30.0)]), np.array([0.8, 0.0])
    fixed = 1e12 * np.eye(3)
    ahead = np.array([[0.0, 0.0, 1.0]])
    past = points - (0.0, off)  # across the line of the first, which is all that counts
    cost, turn = rate_directions(points, past, np.full(2, 1.2), weight, FOCAL, ahead, fixed)
    squared = off * off / (1.2**2 + 0.5**2)
    assert np.abs(turn).max() < 1e-6
    assert cost[0] == pytest.approx(0.5 * 0.8 * squared / (1.0 + squared / CAUCHY), rel=1e-4)
    assert cost[0] < 0.5 * 0.8 * CAUCHY


@given(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03), st.floats(-0.03, 0.03))
def test_a_floor_point_has_the_grey_level_where_it_is_projected(
    tx: float, ty: float, turn: float
) -> None:
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    past = (90.0 + 0.7 * u - 0.4 * v + 0.01 * u * v).astype(np.float32)
    ground = np.array([(x, y) for x in (0.7, 0.9, 1.3) for y in (-0.3, 0.0, 0.2)])
    values, farness = np.linspace(80.0, 120.0, len(ground)), np.linspace(0.0, 0.9, len(ground))
    centre = 0.5 * (CAMERA.width - 1), 0.5 * (CAMERA.height - 1)
    lens = np.array([CAMERA.focal, CAMERA.mount_forward, CAMERA.mount_height, *centre])

    def residuals(at: Array) -> tuple[Array, Array]:
        offsets, slopes = np.zeros(len(ground)), np.zeros((UNKNOWNS + 1, len(ground)))
        matrix = CAMERA.base_from_camera
        _residuals(past, values, ground, farness, lens, matrix, at, offsets, slopes)
        return offsets, slopes

    at = np.array([tx, ty, turn, 0.1, -3.0])
    offsets, slopes = residuals(at)
    c, s = math.cos(turn), math.sin(turn)
    then = ground @ np.array([[c, s], [-s, c]]) + (tx - CAMERA.mount_forward, ty)
    rays = np.column_stack([then, np.full(len(then), -CAMERA.mount_height)])
    x, y, z = (rays @ CAMERA.base_from_camera).T
    column, row = centre[0] + CAMERA.focal * x / z, centre[1] + CAMERA.focal * y / z
    assert ((column > 1) & (column < 61) & (row > 1) & (row < 45)).all()
    grey = 90.0 + 0.7 * column - 0.4 * row + 0.01 * column * row
    assert offsets == pytest.approx(grey - 1.1 * values + 3.0, abs=1e-3)
    for unknown, step in enumerate(1e-3 * np.eye(UNKNOWNS)):
        slope = (residuals(at + step)[0] - residuals(at - step)[0]) / 2e-3
        assert slopes[unknown] == pytest.approx(slope, rel=1e-2, abs=0.5)
    slant = (slopes[0] * tx + slopes[1] * ty) * farness
    assert slopes[SLANT] == pytest.approx(slant)


@pytest.mark.parametrize(("pitch", "rows"), [(0.0, 120 - 51), (0.2, 120 - 35), (-0.2, 120 - 67)])
def test_the_floor_image_begins_eight_rows_above_the_horizon(pitch: float, rows: int) -> None:
    camera = CameraModel(pitch=pitch)  # 120 rows, the horizon of the level one between 59 and 60
    registration = FloorRegistration(RobotModel(camera=camera))
    assert camera.focal == pytest.approx(80.0)
    prepared = registration.prepare(np.zeros((120, 160), np.uint8))
    assert prepared.grey.shape == (rows, 160)
