from __future__ import annotations

import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.localization import (
    MAX_STATES,
    Bayes,
    DiscreteFilter,
    DiscreteParams,
    LandmarkExistence,
    LandmarkObserver,
    Lattice,
)
from navfw.robot import RobotModel
from navfw.signals import LandmarkDetection, Odometry, Pose, Twist, wrap_angle
from navfw.topomap import Landmark, Passage, Place, TopoMap, load_map

PLACES = [
    Place("west", 0.0, 0.0, "room"),
    Place("middle", 6.0, 0.0, "junction"),
    Place("east", 12.0, 0.0, "corridor"),
    Place("north", 6.0, 5.0, "door"),
]
PASSAGES = [
    Passage("west", "middle", 6.0, 2.0),
    Passage("middle", "east", 6.0, 2.0),
    Passage("middle", "north", 5.0, 1.0),
]
MARKS = [
    Landmark("a", "aruco", 1, 3.0, 1.0, -math.pi / 2),
    Landmark("b", "aruco", 2, 9.0, -1.0, math.pi / 2),
    Landmark("c", "aruco", 3, 7.0, 3.0, math.pi),
]
MAP = TopoMap("tee", PLACES, PASSAGES, landmarks=MARKS)


def odometry(pose: Pose, time: float = 0.0) -> Odometry:
    return Odometry(time, pose, Twist(0.0, 0.0), yaw_bias=0.0, still=False)


def detection(mark: Landmark, at: Pose, time: float) -> LandmarkDetection:
    x, y = at.to_local(mark.x, mark.y)
    noise = np.diag((0.01**2, 0.05**2))
    return LandmarkDetection(time, mark.identity, math.atan2(y, x), math.hypot(x, y), noise)


def initialized(pose: Pose | None, at: Pose = Pose(0.0, 0.0, 0.0)) -> DiscreteFilter:  # noqa: B008
    found = DiscreteFilter(MAP, DiscreteParams(), 0.85, LandmarkExistence(0.85))
    found.initialize(pose, odometry(at))
    return found


def test_the_lattice_covers_passages_and_places_only() -> None:
    lattice = Lattice(MAP, 0.25, 8)

    def inside(x: float, y: float) -> float:
        return float(lattice.keep[round(lattice.row(y)), round(lattice.column(x))])

    assert inside(3.0, 0.5) == 1.0
    assert inside(6.0, 2.5) == 1.0
    assert 0.0 < inside(3.0, 1.5) < 1.0
    assert inside(2.0, 4.0) == 0.0
    assert lattice.uniform().sum() == pytest.approx(1.0, rel=1e-4)
    names = list(MAP.places)
    at = (round(lattice.row(0.0)), round(lattice.column(10.0)))
    assert names[lattice.place[at]] == "east"


def test_the_cells_of_a_map_are_counted() -> None:
    lattice = Lattice(MAP, 0.25, 24)
    assert (lattice.shape, lattice.states) == ((41, 69), 26136)
    assert (lattice.keep.sum(), lattice.place.sum()) == (1039.0, 4460)


def test_a_large_map_gets_larger_cells() -> None:
    far = TopoMap("far", [Place("a", 0.0, 0.0), Place("b", 400.0, 400.0)], [])
    lattice = Lattice(far, 0.25, 24)
    assert lattice.cell > 0.25
    assert lattice.keep.size * 24 < 1.2 * MAX_STATES


@settings(max_examples=20, deadline=None)
@given(
    st.floats(-math.pi, math.pi),
    st.lists(st.floats(0.05, 0.4), min_size=5, max_size=20),
)
def test_a_known_pose_moves_as_odometry_does(odom_yaw: float, steps: list[float]) -> None:
    """Along the passage from west to east, with any origin of the odometry."""
    start, first = Pose(0.0, 0.0, 0.0), Pose(3.0, -2.0, odom_yaw)
    found = initialized(start, first)
    at, driven = first, 0.0
    for step in steps:
        at = at.compose(Pose(step, 0.0, 0.0))
        driven += step
        found.predict(odometry(at))
        assert found.belief.sum() == pytest.approx(1.0, rel=1e-3)
        assert found.belief.min() >= 0.0
    cluster = found.cluster
    assert cluster.mass > 0.5
    assert math.hypot(cluster.pose.x - driven, cluster.pose.y) < 0.3 + 0.1 * driven
    assert abs(wrap_angle(cluster.pose.yaw)) < 0.3


def test_turning_does_not_blur_the_belief() -> None:
    found = initialized(Pose(3.0, 0.0, 0.5))
    before = found.cluster
    for yaw in np.linspace(0.0, 6.0, 60):
        found.predict(odometry(Pose(0.0, 0.0, wrap_angle(float(yaw)))))
    assert found.cluster.mass == pytest.approx(before.mass)
    assert found.cluster.pose.yaw == pytest.approx(wrap_angle(before.pose.yaw + 6.0))


def test_two_landmarks_determine_the_pose_and_one_does_not() -> None:
    truth, at = Pose(6.0, 0.0, 0.3), Pose(1.0, 1.0, -2.0)
    found, observer = initialized(None, at), LandmarkObserver(MAP, 0.03)
    assert found.cluster.mass < 0.1
    found.observe(observer.observe(odometry(at, 1.0), [detection(MARKS[1], truth, 1.0)]))
    assert found.support_probability(found.cluster.pose) < 0.9
    found.observe(observer.observe(odometry(at, 2.0), [detection(MARKS[2], truth, 2.0)]))
    cluster = found.cluster
    assert cluster.mass > 0.9
    assert found.support_probability(cluster.pose) > 0.9
    assert math.hypot(cluster.pose.x - truth.x, cluster.pose.y - truth.y) < 0.3
    assert abs(wrap_angle(cluster.pose.yaw - truth.yaw)) < 0.2
    assert found.mass_near(truth, 1.0) > 0.9
    assert found.mass_near(Pose(12.0, 0.0, 0.3), 1.0) < 0.01
    assert next(iter(found.places)) == "middle"
    for k in range(5):
        found.predict(odometry(at.compose(Pose(0.2 * k, 0.05 * k, 0.1 * k)), 2.0 + k))
    cluster = found.cluster
    assert astuple(cluster.pose) == pytest.approx((6.684419, 0.458692, 0.754380), abs=1e-5)
    assert cluster.mass == pytest.approx(0.9812426, abs=1e-6)
    upper = np.triu_indices(3)
    expected = [0.0370542, 0.000196681, -0.000103631, 0.0164949, -8.78116e-5, 0.00682192]
    assert cluster.covariance[upper] == pytest.approx(expected, abs=1e-7)
    spread = [0.2390684, -0.0346344, 0.0, 0.1171152, 0.0, 0.0730851]
    assert cluster.spread[upper] == pytest.approx(spread, abs=1e-6)
    assert found.mass_near(Pose(6.7, 0.4, 0.7), 0.4) == pytest.approx(0.9584035, abs=1e-6)
    shares = [0.9877857, 0.0063047, 0.0046838, 0.0012259]
    assert list(found.places.values()) == pytest.approx(shares, abs=1e-6)


def test_landmarks_support_a_pose_only_if_consistent() -> None:
    """The second landmark is displaced by 0.7 m: a pose halfway would fit both."""
    truth, at = Pose(6.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0)
    found, observer = initialized(truth, at), LandmarkObserver(MAP, 0.03)
    moved = Landmark("b", "aruco", 2, 9.7, -1.0, math.pi / 2)
    seen = [detection(MARKS[2], truth, 1.0), detection(moved, truth, 1.0)]
    found.observe(observer.observe(odometry(at, 1.0), seen))
    assert len(found.supporting(truth)) == 1


def test_a_landmark_is_visible_from_its_front_only() -> None:
    found, observer = initialized(None), LandmarkObserver(MAP, 0.03)
    truth = Pose(3.0, -0.5, math.pi / 2)
    found.observe(
        observer.observe(odometry(Pose(0.0, 0.0, 0.0), 1.0), [detection(MARKS[0], truth, 1.0)])
    )
    behind = np.abs(found.lattice.x - 3.0) < 1.5, found.lattice.y > MARKS[0].y + 0.3
    before = found.lattice.uniform().sum(axis=0)[np.ix_(behind[1], behind[0])].sum()
    after = found.belief.sum(axis=0)[np.ix_(behind[1], behind[0])].sum()
    assert before > 0.02
    assert after < 0.5 * before


def test_off_the_map_the_belief_becomes_uniform() -> None:
    found = initialized(Pose(0.0, 0.0, 0.0))
    found.predict(odometry(Pose(500.0, 0.0, 0.0)))
    assert found.belief.sum() == pytest.approx(1.0, rel=1e-3)
    assert found.cluster.mass < 0.1


def test_the_plugin_is_lost_until_landmarks_support_a_pose() -> None:
    bayes, truth = Bayes(RobotModel()), Pose(6.0, 0.0, 0.3)
    bayes.start(MAP, None, odometry(Pose(0.0, 0.0, 0.0)))
    lost = bayes.update(odometry(Pose(0.0, 0.0, 0.0), 0.1), None, ())
    assert lost.lost
    assert lost.confidence < 0.2
    assert sum(lost.places.values()) == pytest.approx(1.0, rel=1e-3)
    seen = [detection(mark, truth, 0.2) for mark in MARKS[1:]]
    known = bayes.update(odometry(Pose(0.0, 0.0, 0.0), 0.2), None, seen)
    assert not known.lost
    assert known.updates == 2
    assert np.linalg.eigvalsh(known.covariance).min() > 0.0


def test_the_hospital_fits_the_lattice() -> None:
    lattice = Lattice(load_map("maps/hospital.yaml"), 0.25, 24)
    assert 20_000 < lattice.states < 400_000
