"""Moving objects and stixels: values worked out by hand from their formulae."""

import dataclasses
import math

import numpy as np
import pytest
from movers_detections import ROBOT, START, detection

from navfw.egomotion.pairing import camera_motion
from navfw.movers import Tracker
from navfw.movers.localization import locate_moving_objects
from navfw.movers.motion_segmentation import crossing_cells, direction_sigma
from navfw.movers.stixels import find_stixels
from navfw.signals import FlowField, Pose

CAMERA = ROBOT.camera


def flow_at(columns: int, rows: int, top: float, way: float, *, depth: float) -> FlowField:
    """Flow of an upright plane across the path, on cells 6 px apart from ``top`` [px] downwards."""
    x, y = np.meshgrid(
        6.0 * (np.arange(columns) - 0.5 * (columns - 1)), top + 6.0 * np.arange(rows)
    )
    points = np.stack([x, y], axis=-1)
    motion = camera_motion(ROBOT, START, Pose(way, 0.0, 0.0), 0.2)
    motion = dataclasses.replace(motion, yaw_sigma=0.0)
    s, sure = motion.translation, np.ones(x.shape)
    vectors = (points * s[2] - CAMERA.focal * s[:2]) / (depth + s[2])
    return FlowField(1.0, points, vectors, sure, 0.2 * sure, motion, derotated=True)


@pytest.mark.parametrize("speed", [-0.6, 0.4])
def test_a_track_begins_halfway_between_rest_and_a_velocity_as_uncertain_as_the_prior(
    speed: float,
) -> None:
    tracker, certainty = Tracker(ROBOT), 1.0 / 0.4**2
    tracker.update([detection(0.0, 0.0, 1.5, velocity=(0.0, speed), certainty=certainty)], START)
    (track,) = tracker.tracks
    assert track.velocity == pytest.approx((0.0, 0.5 * speed))
    assert np.diag(track.covariance)[2:] == pytest.approx(0.5 * 0.4**2)


@pytest.mark.parametrize(("rows", "number"), [(2, 0), (4, 1)])
def test_only_flat_regions_have_to_be_far_from_rest(rows: int, number: int) -> None:
    flow = flow_at(24, 16, 2.0, 0.0, depth=9.0)
    odd = np.zeros(flow.sigma.shape)
    odd[1 : 1 + rows, 9 : 9 + 8 // rows] = 1.0
    # six of eight cells give the velocity: 6 x 3^2 px^2, below 60 sigma^2
    vectors = flow.vectors + odd[..., None] * (3.0, 0.0)
    moved = dataclasses.replace(flow, vectors=vectors, inconsistency=odd)
    assert len(locate_moving_objects(moved, CAMERA)) == number


@pytest.mark.parametrize(("error", "number"), [(0.36, 1), (0.44, 0)])
def test_cells_of_one_body_may_disagree_by_four_tenths_of_a_pixel(
    error: float, number: int
) -> None:
    flow = flow_at(24, 16, -12.0, 0.0, depth=9.0)
    odd = np.zeros(flow.sigma.shape)
    odd[0:4, 9:11] = 1.0
    off = np.stack([np.full(odd.shape, 1.0), error * (-1.0) ** np.add(*np.indices(odd.shape))], -1)
    vectors = flow.vectors + odd[..., None] * off
    moved = dataclasses.replace(flow, vectors=vectors, inconsistency=odd)
    assert len(locate_moving_objects(moved, CAMERA)) == number


@pytest.mark.parametrize(("share", "number"), [(0.9, 0), (1.1, 1)])
@pytest.mark.parametrize("sigma", [0.05, 0.3])
def test_a_column_crosses_from_five_sigma_on(sigma: float, share: float, number: int) -> None:
    flow = flow_at(15, 6, -60.0, 0.1, depth=30.0)
    flow = dataclasses.replace(flow, sigma=np.full(flow.sigma.shape, sigma))
    lengths = np.hypot(*flow.vectors[:, 7].T)
    errors = np.hypot(np.hypot(sigma, 0.1), direction_sigma(flow.motion) * lengths)
    # straight above the focus of expansion a shift aside is across all the epipolar lines
    shift = share * 5.0 / math.sqrt(np.sum(1.0 / errors**2))
    vectors = flow.vectors.copy()
    vectors[:, 7, 0] += shift
    assert len(crossing_cells(dataclasses.replace(flow, vectors=vectors), CAMERA)) == number


def test_the_confidence_of_a_stixel_rises_linearly_with_its_gain_from_6_to_14() -> None:
    flow = flow_at(15, 8, -42.0, 0.1, depth=1.6)
    gains = {}
    for sigma in (0.2, 0.3, 0.4, 0.5, 0.6, 0.8):
        sure = dataclasses.replace(flow, sigma=np.full(flow.sigma.shape, sigma))
        stixels = find_stixels(sure, CAMERA)
        assert stixels is not None
        spread = math.hypot(0.08, flow.motion.translation_sigma / flow.motion.baseline)
        assert stixels.sigma == pytest.approx(stixels.nearness * spread)
        if 0.0 < stixels.confidence[3] < 1.0:
            gains[sigma**2 + 0.1**2] = 6.0 + 8.0 * stixels.confidence[3]
    assert len(gains) >= 2
    scaled = [variance * gain for variance, gain in gains.items()]
    assert scaled == pytest.approx([scaled[0]] * len(scaled), rel=1e-6)
