"""Situation tables: probabilities, learning, files, and their effect on a belief."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.errors import ConfigError, InputError, UnknownNameError
from navfw.localization import (
    FLOOR,
    SITUATIONS,
    Bayes,
    DiscreteFilter,
    DiscreteParams,
    LandmarkExistence,
    SituationTable,
    Topological,
    learn_table,
    load_table,
    situation_shares,
    situation_table,
)
from navfw.offis import ELEMENTARY
from navfw.robot import RobotModel
from navfw.signals import Odometry, Pose, Twist
from navfw.topomap import PLACE_KINDS, Passage, Place, TopoMap

degrees = st.dictionaries(st.sampled_from([*ELEMENTARY, "door or corner"]), st.floats(0.0, 1.0))
observations = st.lists(st.tuples(st.sampled_from(PLACE_KINDS), degrees), min_size=1, max_size=60)

PLACES = [
    Place("hall", 0.0, 0.0, "room"),
    Place("gate", 4.0, 0.0, "door"),
    Place("gallery", 8.0, 0.0, "corridor"),
    Place("crossing", 12.0, 0.0, "junction"),
]
MAP = TopoMap("row", PLACES, [Passage(a.name, b.name, 4.0, 1.6) for a, b in pairwise(PLACES)])
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
    likelihoods = shipped().likelihoods(MAP, situations)
    if likelihoods is None:
        assert situation_shares(situations)[1] == 0.0
    else:
        assert likelihoods.min() >= FLOOR
        assert likelihoods.max() == pytest.approx(1.0)


def test_a_corridor_favours_corridors_and_unknown_nothing() -> None:
    likelihoods = shipped().likelihoods(MAP, {"corridor": 0.9})
    assert likelihoods is not None
    assert list(MAP.places)[int(likelihoods.argmax())] == "gallery"
    faint = shipped().likelihoods(MAP, {"corridor": 0.1})
    assert faint is not None
    assert np.ptp(faint) < 0.2 * np.ptp(likelihoods)
    assert shipped().likelihoods(MAP, {"unknown": 1.0}) is None


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


def odometry(x: float) -> Odometry:
    return Odometry(0.0, Pose(x, 0.0, 0.0), Twist(0.4, 0.0), 0.0, False)


def test_localisers_refuse_a_missing_table() -> None:
    bayes = Bayes.Params(situations="nowhere.yaml")
    topological = Topological.Params(discrete=DiscreteParams(situations="nowhere.yaml"))
    for localizer in (Bayes(RobotModel(), bayes), Topological(RobotModel(), topological)):
        with pytest.raises(ConfigError, match=r"nowhere\.yaml"):
            localizer.start(MAP, Pose(0.0, 0.0, 0.0), odometry(0.0))


def test_situations_improve_the_place_posterior() -> None:
    """Back and forth along a row of places, from an unknown start, without landmarks."""
    rng = np.random.default_rng(1)
    table = learn_table([(kind, drawn(kind, rng)) for kind in USUAL for _ in range(200)])
    means = []
    for used in (table, None):
        rng = np.random.default_rng(2)
        belief = DiscreteFilter(MAP, DiscreteParams(), 0.85, LandmarkExistence(0.85), used)
        right = []
        belief.initialize(None, odometry(0.0))
        for step in range(1, 90):
            x = 0.1 * step
            true = round(x / 4.0)
            belief.predict(odometry(x))
            belief.observe_situations(drawn(PLACES[true].kind, rng))
            right.append(float(belief.place_probabilities[true]))
        assert belief.place_probabilities.sum() == pytest.approx(1.0, rel=1e-3)
        means.append(np.mean(right))
    assert means[0] > means[1] + 0.1
