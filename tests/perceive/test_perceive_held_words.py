"""Words by the evidence of half a second: held while it flickers, ended by contrary evidence."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from navfw.offis import Offis
from navfw.perceive.sentence_evidence import HELD, HeldWords, Statement
from navfw.robot import RobotModel
from navfw.signals import Label, Percept, Twist
from navfw.testing.behavior_scenes import wall_flow

ROBOT = RobotModel()
SEEN = Offis(ROBOT).perceive(wall_flow(ROBOT, 0.2, 0.8, 2.0, 0.5), Twist(0.3, 0.0))
SEEN = replace(SEEN, label=np.full_like(SEEN.label, Label.UNKNOWN))
TERMS = st.sampled_from(["near", "middle", "far"])
QUADRANTS = ("P1", "P2", "P3", "P4")
WALL, OPEN = {"wall": 0.9, "other": 0.1}, {"open": 0.9, "other": 0.1}
FRONTS = st.sampled_from([{}, WALL, OPEN, {"wall": 0.72}])
Pair = tuple[Percept, Mapping[str, float]]


def said(
    regions: dict[str, str] | None, front: Mapping[str, float] | None = None, *, floor: bool = True
) -> Pair:
    """A percept whose nearest object is in ``regions``, None for unknown, and its fronts."""
    parts = {f"s{name}{part}": term for name, term in (regions or {}).items() for part in "12"}
    layers: dict[str, Any] = {"layer1": regions or {}, "layer2": parts}
    sentence = "Layer1: nearest object is unknown" if regions is None else ""
    degrees: Any = {
        name: {term: float((regions or {}).get(name) == term) for term in ("near", "middle", "far")}
        for name in QUADRANTS
    }
    percept = replace(SEEN, obstacles=layers, quadrants=degrees, sentence=sentence)
    return replace(percept, floor_in_front=float(floor)), front or {}


PAIRS = st.builds(said, st.dictionaries(st.sampled_from(QUADRANTS), TERMS), FRONTS)


def last(
    held: HeldWords, *pairs: Pair | None, rate: float = 20.0, begin: float = 0.0
) -> tuple[Percept, dict[str, Statement]]:
    """The percept and the statements after these; None is a pair without a result."""
    result: Percept = SEEN
    statements: tuple[Statement, ...] = ()
    for number, pair in enumerate(pairs):
        percept, front = said(None, floor=False) if pair is None else pair
        percept = replace(percept, time=begin + number / rate)
        result, statements = held.hold(percept, front, 9.0, known=pair is not None)
    return result, {one.what: one for one in statements}


def test_a_word_of_one_pair_alone_is_not_said() -> None:
    usual, other = said({"P2": "far"}, WALL), said({"P1": "far"}, {"wall": 0.4, "open": 0.6})
    result, of = last(HeldWords(), usual, usual, other)
    assert result.obstacles["layer1"] == {"P2": "far"}
    assert of["front"].says == "Front is a wall"
    assert of["front"].probability == pytest.approx((0.9 + 0.9 + 0.4) / 3)
    ages = [of[what].age for what in ("nearest", "front", "floor")]
    assert ages == pytest.approx([0.05, 0.05, 0])
    changed, _ = last(HeldWords(), usual, other, other, other, other)
    assert changed.obstacles["layer1"] == {"P1": "far"}


def test_contrary_evidence_ends_a_word_at_once() -> None:
    wall, free = said({}, WALL), said({}, OPEN)
    assert "front" not in last(HeldWords(), wall, wall, wall, free)[1]
    obstacle = SEEN.label.copy()
    obstacle[:] = Label.OBSTACLE
    percept, front = said({}, floor=False)
    stands = replace(percept, label=obstacle), front
    assert "floor" in last(HeldWords(), wall, said({}, floor=False))[1]
    assert "floor" not in last(HeldWords(), wall, stands)[1]


def test_nothing_is_open_shortly_before_a_contact() -> None:
    held, (percept, front) = HeldWords(), said({}, OPEN)
    assert held.hold(percept, front, 9.0, known=True)[1][1].says == "Front is open"
    assert "open" not in held.hold(percept, front, 1.9, known=True)[0].sentence


def test_what_comes_near_is_said_at_once() -> None:
    far = said({"P2": "far"})
    result, _ = last(HeldWords(), far, far, far, said({"P2": "far", "P4": "near"}))
    assert result.obstacles["layer1"] == {"P2": "far", "P4": "near"}
    assert "in near distance" in result.sentence
    nearer, _ = last(HeldWords(), far, far, said({"P2": "near"}))
    assert nearer.obstacles["layer1"] == {"P2": "near"}


def test_distances_are_those_of_the_newest_pair() -> None:
    far, middle = said({"P2": "far"}), said({"P2": "middle"})
    result, _ = last(HeldWords(), far, far, far, middle)
    assert result.obstacles["layer1"] == {"P2": "middle"}
    assert result.obstacles["layer2"] == {"sP21": "middle", "sP22": "middle"}
    assert "in middle distance" in result.sentence


def test_regions_are_held_together_until_most_pairs_show_others() -> None:
    one, both, none = said({"P2": "far"}), said({"P2": "far", "P1": "far"}), said({})
    assert last(HeldWords(), one, one, one, both, both)[0].obstacles["layer1"] == {"P2": "far"}
    pairs = (one, one, one, *[none] * 7)
    assert last(HeldWords(), *pairs[:4])[0].obstacles["layer1"] == {"P2": "far"}
    assert last(HeldWords(), *pairs)[0].obstacles["layer1"] == {}


def test_no_object_is_held_where_the_floor_is_seen() -> None:
    near, label = said({"P2": "far", "P4": "near"}), SEEN.label.copy()
    rows, cols = label.shape
    label[rows // 2 :, cols // 2 :] = Label.FLOOR
    floor: Pair = replace(said(None)[0], label=label), {}
    assert last(HeldWords(), near, floor)[0].obstacles["layer1"] == {"P2": "far"}
    stands: Pair = replace(near[0], label=label), {}
    assert last(HeldWords(), near, stands)[0].obstacles["layer1"] == {"P2": "far", "P4": "near"}


@pytest.mark.parametrize("rate", [4.0, 10.0, 30.0])
def test_words_without_evidence_end_after_half_a_second(rate: float) -> None:
    wall, silent = said({"P1": "middle"}, WALL), round(HELD * rate)
    new, of = (last(HeldWords(), wall, *[None] * n, rate=rate)[1] for n in (0, silent))
    ages = dict.fromkeys(("nearest", "front", "floor"), silent / rate)
    assert {what: one.age for what, one in of.items()} == pytest.approx(ages)
    assert 0.5 < of["nearest"].probability < new["nearest"].probability
    gone, none = last(HeldWords(), wall, *[None] * (silent + 1), rate=rate)
    assert not none
    assert "nearest object is unknown" in gone.sentence
    assert gone.obstacles["layer1"] == {}


def test_another_scene_begins_without_the_words_of_the_last() -> None:
    held = HeldWords()
    last(held, said({"P1": "near"}, WALL), said({"P1": "near"}, WALL))
    held.interrupt()
    result, of = last(held, said({"P3": "far"}), begin=0.1)
    assert result.obstacles["layer1"] == {"P3": "far"}
    assert "front" not in of


@given(st.lists(st.none() | PAIRS, max_size=12), st.sampled_from([3.0, 20.0]))
@example([said({}, {"wall": 0.72})] * 3, 20.0)  # their mean is above 0.72
def test_sentence_layers_and_statements_never_contradict(
    pairs: list[Pair | None], rate: float
) -> None:
    held = HeldWords()
    for number, pair in enumerate(pairs):
        result, of = last(held, pair, begin=number / rate)
        first, second = result.obstacles["layer1"], result.obstacles["layer2"]
        assert {name[1:3] for name in second} == set(first)
        assert all(first[name[1:3]] == term for name, term in second.items())
        assert ("unknown" in result.sentence.split(";")[0]) == ("nearest" not in of)
        for one in of.values():
            assert one.says in result.sentence
            assert 0.5 <= one.probability <= 1.0
            assert 0.0 <= one.age <= HELD + 1e-6


@pytest.mark.parametrize("known", [True, False])
def test_the_figures_of_a_percept_stay(*, known: bool) -> None:
    percept, _ = said({"P1": "near"})
    held, _ = HeldWords().hold(percept, {}, 9.0, known=known)
    assert np.array_equal(held.nearness, SEEN.nearness)
    assert held.situations == SEEN.situations
