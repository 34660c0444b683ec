"""Localisation: values worked out by hand from the formulae of filters, fields and noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from navfw.localization.landmark_model import LandmarkObserver
from navfw.localization.motion_model import DeadReckoning
from navfw.localization.place_probabilities import likeliest_places, probability_within
from navfw.localization.plan_kernels import match_points
from navfw.robot import RobotModel
from navfw.signals import LandmarkDetection, Odometry, Pose, Twist
from navfw.topomap import Landmark, Passage, Place, TopoMap

AT_REST = Odometry(0.0, Pose(0.5, -0.3, 0.2), Twist(0.0, 0.0), 0.0, still=True)
PLACES = [Place("a", 1.0, 2.0), Place("b", 4.0, 2.0), Place("c", 4.0, 7.0)]
MAP = TopoMap("m", PLACES, [Passage("a", "b", 3.0, 0.8), Passage("b", "c", 5.0, 2.6)])


def test_the_probability_of_an_error_is_that_of_a_circular_gaussian() -> None:
    for share in (0.1, 1.0, 2.0):
        within = probability_within(np.diag([0.04, 0.01, 1.0]), 0.2 * share)
        assert within == pytest.approx(1.0 - math.exp(-0.5 * share**2))


@pytest.mark.parametrize("variances", [(0.0, 0.0), (3.0, 0.0), (0.5, 2.5), (0.0, 3.0)])
def test_places_are_less_distinct_by_the_mean_variance(variances: tuple[float, float]) -> None:
    places = likeliest_places(MAP, Pose(1.0, 2.0, 0.0), np.diag([*variances, 0.1]))
    odds = math.exp(-0.5 * 3.0**2 / (1.0 + 0.5 * sum(variances)))
    assert places["b"] / places["a"] == pytest.approx(odds)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.0])
def test_dead_reckoning_adds_the_noise_of_each_metre_and_radian(yaw: float) -> None:
    params = DeadReckoning.Params(
        start_xy=0.0,
        start_yaw=0.0,
        along=0.05,
        aside=0.02,
        yaw_by_distance=0.03,
        yaw_by_turning=0.07,
    )
    localizer = DeadReckoning(RobotModel(), params)
    localizer.reset()
    localizer.start(MAP, Pose(1.0, 2.0, yaw), AT_REST)
    ahead = replace(AT_REST, pose=AT_REST.pose.compose(Pose(0.4, 0.0, 0.0)))
    covariance = localizer.update(ahead, None, ()).covariance
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert turn.T @ covariance @ turn == pytest.approx(np.diag([1e-3, 1.6e-4, 3.6e-4]))
    turned = replace(AT_REST, pose=ahead.pose.compose(Pose(0.0, 0.0, -0.5)))
    yaws = localizer.update(turned, None, ()).covariance[2, 2]
    assert yaws == pytest.approx(3.6e-4 + 0.07**2 * 0.5)


def test_the_noise_of_an_observation_has_that_of_the_landmarks_place() -> None:
    mark = Landmark("mark", "aruco", 3, 3.0, 2.0, 0.0)
    observer = LandmarkObserver(TopoMap("m", PLACES, MAP.passages, landmarks=[mark]))
    seen = LandmarkDetection(0.0, "aruco-3", 0.2, 1.6, np.diag([4e-4, 9e-4]))
    (found,) = observer.observe(AT_REST, [seen])
    assert found.measured == pytest.approx((0.2, 1.6))
    assert found.noise == pytest.approx(np.diag([4e-4 + (0.03 / 1.6) ** 2, 9e-4 + 0.03**2]))


def test_points_are_matched_to_walls_wherever_the_camera_was() -> None:
    """Two walls, x = 3 m and y = 2.5 m, seen 5 % too near from before and beside the robot."""
    y, x = np.mgrid[:80, :80] * 0.05 + 0.025
    field = (np.minimum(3.0 - x, 2.5 - y) / 0.05).astype(np.float32)
    pose, scale = Pose(1.2, 0.9, 0.3), 1.05
    walls = [(3.0, 0.3 + 0.1 * k) for k in range(15)] + [(0.8 + 0.1 * k, 2.5) for k in range(15)]
    points = np.array([pose.to_local(*wall) for wall in walls])
    origins = np.array([(0.3 - 0.02 * k, 0.2 * math.sin(k)) for k in range(len(walls))])
    near = origins + (points - origins) / scale
    sigma, start = np.full(len(walls), 0.02), np.array([1.23, 0.87, 0.32, 0.0])
    prior = np.diag([1.0, 1.0, 1.0, 1e-2])
    state, _, belonging = match_points(near, sigma, origins, field, 0.05, start, prior)
    assert state == pytest.approx((1.2, 0.9, 0.3, math.log(scale)), abs=2e-3)
    assert belonging == pytest.approx(0.9, abs=0.01)  # 0.1 for anything else
