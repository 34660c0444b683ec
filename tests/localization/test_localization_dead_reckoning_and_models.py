"""Models of motion, measurement and landmarks; dead reckoning; the posterior of places."""

import math
from collections.abc import Callable
from dataclasses import astuple, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from localization_drives import odometry

from navfw.errors import InputError
from navfw.localization.landmark_model import (
    LandmarkExistence,
    associate,
    expected_measurement,
    joseph,
)
from navfw.localization.motion_model import (
    DeadReckoning,
    MotionParams,
    motion_noise,
    predict,
    process_noise,
)
from navfw.localization.place_probabilities import PlacePosterior, likeliest_places
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Belief, Odometry, Pose, Twist, position_sigma, wrap_angle
from navfw.topomap import Place, TopoMap

ELSEWHERE_DENSITY = 0.05
GATE = 9.0
BY_FLOOR = 0.01

coordinates = st.floats(-20.0, 20.0)
angles = st.floats(-3.0, 3.0)
biases = st.floats(-0.02, 0.02)
states = st.tuples(coordinates, coordinates, angles, biases).map(np.array)
moves = st.builds(Pose, st.floats(-0.2, 0.2), st.floats(-0.05, 0.05), st.floats(-0.3, 0.3))
factors = st.lists(st.floats(-1.0, 1.0), min_size=16, max_size=16)


def covariance_of(factor: list[float]) -> Array:
    root = np.array(factor).reshape(4, 4)
    return np.asarray(root @ root.T + 1e-4 * np.eye(4))


def numeric(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    columns = []
    for axis in range(len(at)):
        up, down = at.copy(), at.copy()
        up[axis] += step
        down[axis] -= step
        columns.append((function(up) - function(down)) / (2.0 * step))
    return np.stack(columns, axis=1)


@given(states, moves, st.floats(0.01, 0.5), biases)
def test_the_motion_jacobian_is_the_derivative(
    state: Array, moved: Pose, dt: float, known: float
) -> None:
    def step(at: Array) -> Array:
        return predict(at, moved, (known - at[3]) * dt, dt)[0]

    _, jacobian = predict(state, moved, (known - float(state[3])) * dt, dt)
    assert np.allclose(jacobian, numeric(step, state), atol=1e-6)


@given(states, coordinates, coordinates)
def test_the_landmark_jacobian_is_the_derivative(state: Array, x: float, y: float) -> None:
    if math.hypot(x - state[0], y - state[1]) < 0.3:
        return
    seen, jacobian = expected_measurement(state, x, y)

    def difference(at: Array) -> Array:
        again = expected_measurement(at, x, y)[0]
        return np.array((wrap_angle(float(again[0] - seen[0])), again[1] - seen[1]))

    assert np.allclose(jacobian, numeric(difference, state), atol=1e-5)


@given(factors, st.lists(st.floats(-2.0, 2.0), min_size=8, max_size=8))
def test_the_joseph_form_is_positive_for_any_gain(factor: list[float], gain: list[float]) -> None:
    _, jacobian = expected_measurement(np.zeros(4), 2.0, 1.0)
    noise = np.diag((1e-4, 1e-2))
    updated = joseph(covariance_of(factor), np.array(gain).reshape(4, 2), jacobian, noise)
    assert np.array_equal(updated, updated.T)
    assert np.linalg.eigvalsh(updated).min() > -1e-9


@given(states, factors, st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(0.05, 0.99))
def test_an_update_keeps_the_covariance_positive_and_moves_at_most_as_far_as_the_ekf(
    state: Array, factor: list[float], bearing: float, distance: float, existence: float
) -> None:
    covariance = 0.05 * covariance_of(factor)
    at = (float(state[0]) + 2.0, float(state[1]) - 1.5)
    seen = expected_measurement(state, *at)[0] + np.array((bearing, distance))
    noise = np.diag((4e-4, 1e-2))
    updated = associate(state, covariance, seen, noise, at, existence)
    certain = associate(state, covariance, seen, noise, at, 1.0 - 1e-12)
    assert np.linalg.eigvalsh(updated.covariance).min() > 0.0
    assert 0.0 <= updated.probability <= certain.probability + 1e-12
    assert np.linalg.norm((updated.state - state)[:2]) <= (
        np.linalg.norm((certain.state - state)[:2]) + 1e-9
    )


def test_detections_outside_the_gate_change_nothing() -> None:
    state, covariance = np.zeros(4), np.diag((0.01, 0.01, 1e-3, 1e-6))
    seen = expected_measurement(state, 3.0, 0.0)[0] + np.array((0.0, 1.5))
    found = associate(state, covariance, seen, np.diag((1e-4, 1e-2)), (3.0, 0.0), 0.9)
    assert found.distance > GATE
    assert found.probability == 0.0
    assert np.array_equal(found.state, state)
    assert np.array_equal(found.covariance, covariance)


def test_the_likelihood_is_that_of_the_gaussian_against_elsewhere() -> None:
    state, covariance, noise = np.zeros(4), np.zeros((4, 4)), np.diag((0.02**2, 0.1**2))
    seen = expected_measurement(state, 3.0, 0.0)[0]
    found = associate(state, covariance, seen, noise, (3.0, 0.0), 0.9)
    peak = 1.0 / (2.0 * math.pi * 0.02 * 0.1)
    assert found.likelihood_ratio == pytest.approx(peak / ELSEWHERE_DENSITY)


def test_the_noise_follows_from_the_data_sheets() -> None:
    sigma = motion_noise(MotionParams(), RobotModel(skid=0.1))
    expected = (0.02269912, 0.01, 0.10606602, 3.3798156e-4, 0.005, 4.1394118e-4, 1.3089969e-4)
    assert astuple(sigma) == pytest.approx(expected)
    wheels = Odometry(1.0, Pose(0.3, 0.02, 0.4), Twist(0.5, 0.0), 0.0, still=False, silent=True)
    noise = process_noise(0.5, wheels.pose, 0.2, sigma, wheels)
    numbers = [0.07078221, 0.03619371, 0.02430278, 1.0022846e-5, 3.4269460e-9]
    assert noise[[0, 0, 1, 2, 3], [0, 1, 1, 2, 3]] == pytest.approx(numbers)


@given(angles, moves, st.floats(0.01, 0.5))
def test_the_noise_is_positive_and_turns_with_the_robot(yaw: float, moved: Pose, dt: float) -> None:
    sigma = motion_noise(MotionParams(), RobotModel())
    wheels = Odometry(1.0, moved, Twist(0.0, 0.0), 0.0, still=False)
    noise = process_noise(yaw, moved, dt, sigma, wheels)
    assert np.linalg.eigvalsh(noise).min() >= -1e-15
    ahead = process_noise(0.0, moved, dt, sigma, wheels)
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s], [s, c]])
    assert np.allclose(noise[:2, :2], turn @ ahead[:2, :2] @ turn.T)
    commanded = process_noise(yaw, moved, dt, sigma, replace(wheels, silent=True))
    assert np.trace(commanded) >= np.trace(noise)


@pytest.mark.parametrize("silent", [False, True])
def test_a_distance_measured_by_the_floor_does_not_depend_on_the_wheels(silent: bool) -> None:
    sigma = replace(motion_noise(MotionParams(), RobotModel()), along=0.2)
    wheels = Odometry(1.0, Pose(0.5, 0.0, 0.0), Twist(0.5, 0.0), 0.0, still=False, silent=silent)
    by_wheels = process_noise(0.0, wheels.pose, 1.0, sigma, wheels)
    by_floor = process_noise(0.0, wheels.pose, 1.0, sigma, replace(wheels, by_floor=True))
    assert by_floor[0, 0] == pytest.approx(BY_FLOOR**2 * 0.5)
    assert by_wheels[0, 0] >= 0.2**2 * 0.5
    assert np.array_equal(by_floor[1:, 1:], by_wheels[1:, 1:])


def test_evidence_for_a_landmark_is_bounded_and_weighted() -> None:
    existence, probabilities = LandmarkExistence(0.7), []
    for ratio, weight in ((0.0, 1.0), (0.5, 0.5), (100.0, 1.0), (1.2, 0.3)):
        existence.update("m", ratio, weight)
        probabilities.append(existence.probability("m"))
    assert probabilities == pytest.approx([0.34238087, 0.26908385, 0.50018107, 0.51385164])
    for ratio, bound in ((0.0, 0.00669285), (1e9, 0.98201379)):
        for _ in range(9):
            existence.update("m", ratio)
        assert existence.probability("m") == pytest.approx(bound)


@given(st.lists(st.floats(0.0, 1e6), max_size=40), st.floats(0.5, 0.95))
def test_three_misses_make_a_landmark_unlikely(likelihoods: list[float], prior: float) -> None:
    existence = LandmarkExistence(prior)
    assert existence.probability("aruco-1") == pytest.approx(prior)
    for likelihood in likelihoods:
        existence.update("aruco-1", likelihood)
        assert 0.0 < existence.probability("aruco-1") < 1.0
    for _ in range(3):
        existence.update("aruco-2", 0.0)
    assert existence.probability("aruco-2") < 0.5
    existence.reset(lambda identity: identity == "aruco-2")
    assert existence.probability("aruco-2") == pytest.approx(prior)


# --- dead reckoning -------------------------------------------------------------------------------

ROOMS = TopoMap("rooms", [Place(f"room-{i}", 3.0 * i, 0.0) for i in range(20)], [])

poses = st.builds(Pose, coordinates, coordinates, st.floats(-math.pi, math.pi))


def follow(
    start: Pose, track: list[Pose], params: DeadReckoning.Params | None = None
) -> list[Belief]:
    localizer = DeadReckoning(RobotModel(), params)
    localizer.reset()
    localizer.start(ROOMS, start, odometry(track[0]))
    return [localizer.update(odometry(p, float(i)), None, ()) for i, p in enumerate(track)]


@given(poses, st.lists(poses, min_size=1, max_size=5))
def test_the_pose_is_the_start_and_the_odometry_since(start: Pose, track: list[Pose]) -> None:
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
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = x + c * ahead - s * left, y + s * ahead + c * left
        yaw = yaw + move.yaw + noise["yaw_by_distance"] * step * rng.standard_normal(4000)
        yaw = yaw + noise["yaw_by_turning"] * turn * rng.standard_normal(4000)
    params = DeadReckoning.Params.model_validate({"start_xy": 0.0, "start_yaw": 0.0, **noise})
    belief = follow(track[0], track, params)[-1]
    sampled = np.cov(np.stack([x, y, yaw]))
    assert np.allclose(belief.covariance, sampled, atol=0.08 * np.abs(sampled).max())


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
def test_the_position_sigma_is_the_longer_half_axis(long: float, short: float, turn: float) -> None:
    c, s = math.cos(turn), math.sin(turn)
    axes = np.array([[c, -s], [s, c]])
    covariance = np.diag([0.0, 0.0, 5.0])
    covariance[:2, :2] = axes @ np.diag([long**2, short**2]) @ axes.T
    assert position_sigma(covariance) == pytest.approx(max(long, short), abs=1e-6)
    largest = max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0)
    sigma = Belief(0.0, Pose(0.0, 0.0, 0.0), covariance).sigma
    assert sigma**2 == pytest.approx(largest, abs=1e-9)
