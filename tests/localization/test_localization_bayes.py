"""The discrete filter: its lattice, landmarks, and the situations of OFFIS as evidence."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from localization_drives import detection, odometry
from navfw_benchmarks.plugins.localizers import Bayes

from navfw.errors import ConfigError, InputError, UnknownNameError
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_model import LandmarkExistence, LandmarkObserver
from navfw.localization.lattice import Lattice
from navfw.localization.place_probabilities import (
    SITUATIONS,
    SituationTable,
    learn_table,
    load_table,
    situation_shares,
    situation_table,
)
from navfw.localization.topological import Topological
from navfw.offis.elementary_situations import ELEMENTARY
from navfw.robot import RobotModel
from navfw.signals import Pose, wrap_angle
from navfw.topomap import PLACE_KINDS, Landmark, Passage, Place, TopoMap, load_map

MAX_STATES = 3000000
FLOOR = 0.05

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
ORIGIN = Pose(0.0, 0.0, 0.0)
MAP = TopoMap("tee", PLACES, PASSAGES, landmarks=MARKS)


def initialized(pose: Pose | None, at: Pose = ORIGIN) -> DiscreteFilter:
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


def test_the_cells_of_a_map_are_counted_and_a_large_map_gets_larger_ones() -> None:
    lattice = Lattice(MAP, 0.25, 24)
    assert (lattice.shape, lattice.states) == ((41, 69), 26136)
    assert (lattice.keep.sum(), lattice.place.sum()) == (1039.0, 4460)
    hospital = Lattice(load_map("maps/hospital.yaml"), 0.25, 24)
    assert 20_000 < hospital.states < 400_000
    far = TopoMap("far", [Place("a", 0.0, 0.0), Place("b", 400.0, 400.0)], [])
    lattice = Lattice(far, 0.25, 24)
    assert lattice.cell > 0.25
    assert lattice.keep.size * 24 < 1.2 * MAX_STATES


@settings(max_examples=20, deadline=None)
@given(st.floats(-math.pi, math.pi), st.lists(st.floats(0.05, 0.4), min_size=5, max_size=20))
def test_a_known_pose_moves_as_odometry_does(odom_yaw: float, steps: list[float]) -> None:
    """Along the passage from west to east, with any origin of the odometry."""
    at, driven = Pose(3.0, -2.0, odom_yaw), 0.0
    found = initialized(ORIGIN, at)
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


def mass_near(found: DiscreteFilter, pose: Pose, radius: float) -> float:
    """The probability within ``radius`` [m] of ``pose`` (map), at similar headings."""
    lattice, last, shifted = found.lattice, found._last, found._shifted_at
    turned, dx, dy = wrap_angle(pose.yaw - last.yaw), last.x - shifted.x, last.y - shifted.y
    off = np.array([wrap_angle(yaw - turned) for yaw in lattice.yaw])
    c, s = math.cos(turned), math.sin(turned)
    x = lattice.x[None, :] - (pose.x - c * dx + s * dy)
    y = lattice.y[:, None] - (pose.y - s * dx - c * dy)
    belief = found.belief[np.abs(off) <= 5.0 * math.pi / lattice.headings]
    return float((belief * (np.hypot(x, y) <= radius)[None]).sum())


def test_two_landmarks_determine_the_pose_and_one_does_not() -> None:
    truth, at = Pose(6.0, 0.0, 0.3), Pose(1.0, 1.0, -2.0)
    found, observer = initialized(None, at), LandmarkObserver(MAP)
    assert found.cluster.mass < 0.1
    found.observe(observer.observe(odometry(at, 1.0), [detection(MARKS[1], truth, 1.0)]))
    assert found.support_probability(found.cluster.pose) < 0.9
    found.observe(observer.observe(odometry(at, 2.0), [detection(MARKS[2], truth, 2.0)]))
    cluster = found.cluster
    assert cluster.mass > 0.9
    assert found.support_probability(cluster.pose) > 0.9
    assert math.hypot(cluster.pose.x - truth.x, cluster.pose.y - truth.y) < 0.3
    assert abs(wrap_angle(cluster.pose.yaw - truth.yaw)) < 0.2
    assert mass_near(found, truth, 1.0) > 0.9
    assert mass_near(found, Pose(12.0, 0.0, 0.3), 1.0) < 0.01
    assert next(iter(found.places)) == "middle"


def test_landmarks_support_a_pose_only_if_consistent() -> None:
    """The second landmark is displaced by 0.7 m: a pose halfway would fit both."""
    truth, at = Pose(6.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0)
    found, observer = initialized(truth, at), LandmarkObserver(MAP)
    moved = Landmark("b", "aruco", 2, 9.7, -1.0, math.pi / 2)
    seen = [detection(MARKS[2], truth, 1.0), detection(moved, truth, 1.0)]
    found.observe(observer.observe(odometry(at, 1.0), seen))
    assert len(found.supporting(truth)) == 1


def test_a_landmark_is_visible_from_its_front_only() -> None:
    found, observer = initialized(None), LandmarkObserver(MAP)
    truth = Pose(3.0, -0.5, math.pi / 2)
    found.observe(observer.observe(odometry(ORIGIN, 1.0), [detection(MARKS[0], truth, 1.0)]))
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
    bayes.start(MAP, None, odometry(ORIGIN))
    lost = bayes.update(odometry(ORIGIN, 0.1), None, ())
    assert lost.lost
    assert lost.confidence < 0.2
    assert sum(lost.places.values()) == pytest.approx(1.0, rel=1e-3)
    seen = [detection(mark, truth, 0.2) for mark in MARKS[1:]]
    known = bayes.update(odometry(ORIGIN, 0.2), None, seen)
    assert not known.lost
    assert known.updates == 2
    assert np.linalg.eigvalsh(known.covariance).min() > 0.0


# --- situation tables: probabilities, learning, files, and their effect on a belief ---------------

degrees = st.dictionaries(st.sampled_from([*ELEMENTARY, "door or corner"]), st.floats(0.0, 1.0))
observations = st.lists(st.tuples(st.sampled_from(PLACE_KINDS), degrees), min_size=1, max_size=60)

ROW = [
    Place("hall", 0.0, 0.0, "room"),
    Place("gate", 4.0, 0.0, "door"),
    Place("gallery", 8.0, 0.0, "corridor"),
    Place("crossing", 12.0, 0.0, "junction"),
]
ROW_MAP = TopoMap("row", ROW, [Passage(a.name, b.name, 4.0, 1.6) for a, b in pairwise(ROW)])
USUAL = {
    "room": {"corner": 0.7, "wall": 0.3},
    "door": {"wall": 0.6, "door": 0.4},
    "corridor": {"corridor": 0.9, "door": 0.1},
    "junction": {"corridor": 0.5, "door": 0.5},
}


def shipped() -> SituationTable:
    table = situation_table("learnt")
    assert table is not None
    return table


def test_the_situations_are_those_of_offis() -> None:
    assert {*SITUATIONS, "unknown"} == set(ELEMENTARY)


def test_the_shipped_table_has_all_kinds_and_separates_them() -> None:
    table = shipped()
    assert set(table.seen_at) == set(PLACE_KINDS)
    for row in table.seen_at.values():
        assert row.sum() == pytest.approx(1.0)
        assert row.min() >= 0.0
    corridor = SITUATIONS.index("corridor")
    shares = {kind: row[corridor] for kind, row in table.seen_at.items()}
    assert shares["corridor"] > 2.0 * max(shares["room"], shares["door"])
    assert all(count > 50 for kind, count in table.observations.items() if kind != "danger")


@given(degrees)
def test_situations_never_exclude_a_place(situations: dict[str, float]) -> None:
    likelihoods = shipped().likelihoods(ROW_MAP, situations)
    if likelihoods is None:
        assert situation_shares(situations)[1] == 0.0
    else:
        assert likelihoods.min() >= FLOOR
        assert likelihoods.max() == pytest.approx(1.0)


def test_a_corridor_favours_corridors_and_unknown_nothing() -> None:
    likelihoods = shipped().likelihoods(ROW_MAP, {"corridor": 0.9})
    assert likelihoods is not None
    assert list(ROW_MAP.places)[int(likelihoods.argmax())] == "gallery"
    faint = shipped().likelihoods(ROW_MAP, {"corridor": 0.1})
    assert faint is not None
    assert np.ptp(faint) < 0.2 * np.ptp(likelihoods)
    assert shipped().likelihoods(ROW_MAP, {"unknown": 1.0}) is None


@given(observations)
def test_a_learnt_table_is_a_distribution_symmetric_in_left_and_right(
    seen: list[tuple[str, dict[str, float]]],
) -> None:
    if not any(situation_shares(situations)[1] for _, situations in seen):
        with pytest.raises(ValueError, match="reported no situation"):
            learn_table(seen)
        return
    table = learn_table(seen)
    for row in table.seen_at.values():
        assert row.sum() == pytest.approx(1.0)
        left, right = (row[SITUATIONS.index(f"{side} wall")] for side in ("left", "right"))
        assert left == pytest.approx(right)

    def mirrored(name: str) -> str:
        return name.replace("left", "x").replace("right", "left").replace("x", "right")

    again = learn_table(
        (kind, {mirrored(name): degree for name, degree in situations.items()})
        for kind, situations in seen
    )
    for kind, row in table.seen_at.items():
        assert np.allclose(row, again.seen_at[kind])


def drawn(kind: str, rng: np.random.Generator) -> dict[str, float]:
    """A random observation at a place of that kind, distributed as ``USUAL``."""
    names, shares = zip(*USUAL[kind].items(), strict=True)
    return {names[int(rng.choice(len(names), p=shares))]: float(rng.uniform(0.6, 1.0))}


def test_few_observations_are_drawn_to_the_mean_and_many_are_not() -> None:
    rng = np.random.default_rng(0)
    seen = [(kind, drawn(kind, rng)) for kind in USUAL for _ in range(1000)]
    table = learn_table(seen)
    for kind, usual in USUAL.items():
        row = table.seen_at[kind]
        for name, share in usual.items():
            assert row[SITUATIONS.index(name)] == pytest.approx(share, abs=0.06)
    mean = np.mean([table.seen_at[kind] for kind in USUAL], axis=0)
    assert np.allclose(table.seen_at["danger"], mean, atol=0.02)
    one = learn_table([*seen, ("corner", {"door": 1.0})])
    assert np.allclose(one.seen_at["corner"], mean, atol=0.06)


def test_a_table_is_the_same_after_writing_and_reading(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(shipped().text('from "all" drives: many'))
    again = load_table(file)
    for kind, row in shipped().seen_at.items():
        assert np.allclose(row, again.seen_at[kind], atol=1e-3)
    assert situation_table(str(file)) is not None
    assert situation_table("none") is None


@pytest.mark.parametrize(
    ("text", "error", "expected"),
    [
        ("seen_at: {room: {door: 1}, dor: {door: 1}}", UnknownNameError, "mean 'door'?"),
        ("seen_at: {room: {dooor: 1}}", UnknownNameError, "seen_at.room.dooor: unknown situation"),
        ("seen_at: {room: {door: 0.7}}", ConfigError, "mine.yaml:1: seen_at.room: expected"),
        ("seen_at: {room: {door: -1}}", ConfigError, "seen_at.room.door: expected a number >= 0"),
        ("seen: {room: {door: 1}}", ConfigError, "did you mean 'seen_at'?"),
        ("seen_at: {}", ConfigError, "seen_at"),
    ],
)
def test_an_invalid_table_is_an_error(
    text: str, error: type[InputError], expected: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(error) as caught:
        load_table(file)
    assert "mine.yaml:1" in str(caught.value)
    assert expected in str(caught.value)


def test_localisers_refuse_a_missing_table() -> None:
    bayes = Bayes.Params(situations="nowhere.yaml")
    topological = Topological.Params(discrete=DiscreteParams(situations="nowhere.yaml"))
    for localizer in (Bayes(RobotModel(), bayes), Topological(RobotModel(), topological)):
        with pytest.raises(ConfigError, match=r"nowhere\.yaml"):
            localizer.start(ROW_MAP, ORIGIN, odometry(ORIGIN))


def test_situations_improve_the_place_posterior() -> None:
    """Back and forth along a row of places, from an unknown start, without landmarks."""
    rng = np.random.default_rng(1)
    table = learn_table([(kind, drawn(kind, rng)) for kind in USUAL for _ in range(200)])
    means = []
    for used in (table, None):
        rng = np.random.default_rng(2)
        belief = DiscreteFilter(ROW_MAP, DiscreteParams(), 0.85, LandmarkExistence(0.85), used)
        right = []
        belief.initialize(None, odometry(ORIGIN))
        for step in range(1, 90):
            x = 0.1 * step
            true = round(x / 4.0)
            belief.predict(odometry(Pose(x, 0.0, 0.0)))
            belief.observe_situations(drawn(ROW[true].kind, rng))
            right.append(float(belief.place_probabilities[true]))
        assert belief.place_probabilities.sum() == pytest.approx(1.0, rel=1e-3)
        means.append(np.mean(right))
    assert means[0] > means[1] + 0.1
