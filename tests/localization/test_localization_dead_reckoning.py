from __future__ import annotations

import math
from dataclasses import astuple
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from localization_drives import odometry

from navfw.errors import InputError
from navfw.localization import DeadReckoning, PlacePosterior, likeliest_places
from navfw.robot import RobotModel
from navfw.signals import Belief, Pose, position_sigma
from navfw.topomap import Place, TopoMap

ROOMS = TopoMap("rooms", [Place(f"room-{i}", 3.0 * i, 0.0) for i in range(20)], [])

coordinates = st.floats(-10.0, 10.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose, coordinates, coordinates, angles)


def follow(
    start: Pose, track: list[Pose], params: DeadReckoning.Params | None = None
) -> list[Belief]:
    localizer = DeadReckoning(RobotModel(), params)
    localizer.reset()
    localizer.start(ROOMS, start, odometry(track[0]))
    return [localizer.update(odometry(p, float(i)), None, ()) for i, p in enumerate(track)]


@given(poses, st.lists(poses, min_size=1, max_size=5))
def test_the_pose_is_the_start_composed_with_the_odometry_since(
    start: Pose, track: list[Pose]
) -> None:
    beliefs = follow(start, track)
    for belief, at in zip(beliefs, track, strict=True):
        off = belief.pose.relative(start.compose(track[0].relative(at)))
        assert astuple(off) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@given(poses, st.lists(poses, min_size=2, max_size=6))
def test_the_covariance_never_shrinks(start: Pose, track: list[Pose]) -> None:
    spreads = [np.linalg.det(b.covariance) for b in follow(start, track)]
    assert all(b >= a * (1.0 - 1e-9) for a, b in pairwise(spreads))
    for belief in follow(start, track):
        assert np.allclose(belief.covariance, belief.covariance.T)
        assert np.linalg.eigvalsh(belief.covariance).min() > 0.0


def test_the_covariance_is_that_of_many_noisy_drives() -> None:
    """An L of 4 m and 3 m, driven 4000 times with the noise of the parameters."""
    rng = np.random.default_rng(3)
    noise = {"along": 0.05, "aside": 0.02, "yaw_by_distance": 0.02, "yaw_by_turning": 0.03}
    moves = [Pose(0.2, 0.0, 0.0)] * 20 + [Pose(0.0, 0.0, 0.1)] * 16 + [Pose(0.2, 0.0, 0.0)] * 15
    track = [Pose(0.0, 0.0, 0.0)]
    for move in moves:
        track.append(track[-1].compose(move))
    x, y, yaw = np.zeros((3, 4000))
    for move in moves:
        step, turn = math.sqrt(move.x), math.sqrt(abs(move.yaw))
        ahead = move.x + noise["along"] * step * rng.standard_normal(4000)
        left = noise["aside"] * step * rng.standard_normal(4000)
        x, y = (
            x + np.cos(yaw) * ahead - np.sin(yaw) * left,
            (y + np.sin(yaw) * ahead + np.cos(yaw) * left),
        )
        yaw = yaw + move.yaw + noise["yaw_by_distance"] * step * rng.standard_normal(4000)
        yaw = yaw + noise["yaw_by_turning"] * turn * rng.standard_normal(4000)
    params = DeadReckoning.Params.model_validate({"start_xy": 0.0, "start_yaw": 0.0, **noise})
    belief = follow(track[0], track, params)[-1]
    sampled = np.cov(np.stack([x, y, yaw]))
    assert np.allclose(belief.covariance, sampled, atol=0.08 * np.abs(sampled).max())


def test_the_usual_noise_gives_these_numbers() -> None:
    track = [Pose(0.0, 0.0, 0.0), Pose(1.0, 0.2, 0.4), Pose(1.5, 1.0, 1.0)]
    belief = follow(Pose(1.0, 2.0, 0.3), track)[-1]
    expected = [0.002032503, 0.000428697, -0.000199595, 0.001113989, 0.000129549, 0.00024908]
    assert belief.covariance[np.triu_indices(3)] == pytest.approx(expected, abs=1e-9)
    shares = [0.8703169, 0.1289478, 0.000735242]
    assert list(belief.places.values())[:3] == pytest.approx(shares, abs=1e-7)
    assert len(belief.places) == 8


@given(poses)
def test_places_are_probabilities_with_the_nearest_first(start: Pose) -> None:
    (belief,) = follow(start, [Pose(0.0, 0.0, 0.0)])
    weights = list(belief.places.values())
    assert sum(weights) == pytest.approx(1.0)
    assert weights == sorted(weights, reverse=True)
    assert next(iter(belief.places)) == ROOMS.nearest_place(start.x, start.y).name
    assert len(weights) == 8


def test_places_follow_the_robot() -> None:
    beliefs = follow(Pose(0.0, 0.0, 0.0), [Pose(0.5 * i, 0.0, 0.0) for i in range(13)])
    assert max(beliefs[0].places, key=lambda n: beliefs[0].places[n]) == "room-0"
    assert max(beliefs[-1].places, key=lambda n: beliefs[-1].places[n]) == "room-2"


def test_an_unknown_start_is_refused_with_a_remedy() -> None:
    with pytest.raises(InputError, match=r"unknown start.*start pose"):
        DeadReckoning(RobotModel()).start(ROOMS, None, odometry(Pose(0.0, 0.0, 0.0)))


# --- the place posterior of a moving pose ------------------------------------------------------

TWO = TopoMap("two", [Place("west", 0.0, 0.0, "room"), Place("east", 4.0, 0.0, "room")], [])
SMALL = np.diag([0.01, 0.01, 0.01])


@pytest.mark.parametrize("heading", [0.0, math.pi / 4.0, math.pi / 2.0])
def test_probabilities_are_computed_again_after_a_distance_in_any_direction(heading: float) -> None:
    posterior = PlacePosterior(TWO, refresh=0.1)
    first = posterior.at(Pose(1.0, 0.0, 0.0), SMALL)
    assert first == likeliest_places(TWO, Pose(1.0, 0.0, 0.0), SMALL)
    c, s = math.cos(heading), math.sin(heading)
    assert posterior.at(Pose(1.0 + 0.09 * c, 0.09 * s, heading), SMALL) is first
    farther = Pose(1.0 + 0.11 * c, 0.11 * s, heading)
    assert posterior.at(farther, SMALL) is not first
    assert posterior.at(farther, 4.0 * SMALL) == likeliest_places(TWO, farther, SMALL)


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0), st.floats(-math.pi, math.pi))
def test_the_position_sigma_is_the_largest_half_axis(
    long: float, short: float, turn: float
) -> None:
    c, s = math.cos(turn), math.sin(turn)
    axes = np.array([[c, -s], [s, c]])
    covariance = np.diag([0.0, 0.0, 5.0])
    covariance[:2, :2] = axes @ np.diag([long**2, short**2]) @ axes.T
    assert position_sigma(covariance) == pytest.approx(max(long, short), abs=1e-6)
    largest = max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0)
    sigma = Belief(0.0, Pose(0.0, 0.0, 0.0), covariance).sigma
    assert sigma**2 == pytest.approx(largest, abs=1e-9)
