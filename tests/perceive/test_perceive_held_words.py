"""Words that hold still while evidence flickers, and change at once when something comes near."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.offis import Offis
from navfw.perceive.sentence_evidence import HeldWords
from navfw.robot import RobotModel
from navfw.signals import Label, Percept, Twist
from navfw.testing.behavior_scenes import wall_flow

ROBOT = RobotModel()
SEEN = Offis(ROBOT).perceive(wall_flow(ROBOT, 0.2, 0.8, 2.0, 0.5), Twist(0.3, 0.0))
SEEN = replace(SEEN, label=np.full_like(SEEN.label, Label.UNKNOWN))
TERMS = st.sampled_from(["near", "middle", "far"])
QUADRANTS = ("P1", "P2", "P3", "P4")


def said(regions: dict[str, str] | None, front: str = "unknown", *, floor: bool = True) -> Percept:
    """A percept whose nearest object is in ``regions``, None for unknown."""
    parts = {f"s{name}{part}": term for name, term in (regions or {}).items() for part in "12"}
    layers: dict[str, Any] = {"layer1": regions or {}, "layer2": parts}
    clauses = [f"Front is {front}", *(["Floor in front"] if floor else [])]
    if regions is None:
        clauses.append("Layer1: nearest object is unknown")
    return replace(SEEN, obstacles=layers, sentence="; ".join(clauses))


def last(held: HeldWords, *percepts: Percept | None) -> Percept:
    """The percept that is held after these; None is a pair without a result."""
    result = SEEN
    for percept in percepts:
        known = percept is not None
        result = held.hold(said(None) if percept is None else percept, known=known)
    return result


def test_a_word_of_one_pair_alone_is_not_said() -> None:
    usual, other = said({"P2": "far"}, "a wall"), said({"P1": "far"}, "a corridor", floor=False)
    result = last(HeldWords(), usual, usual, other)
    assert result.obstacles["layer1"] == {"P2": "far"}
    assert "Front is a wall; Floor in front" in result.sentence
    changed = last(HeldWords(), usual, other, other, other, other)
    assert changed.obstacles["layer1"] == {"P1": "far"}
    assert changed.sentence.endswith("Front is a corridor")


def test_what_comes_near_is_said_at_once() -> None:
    far = said({"P2": "far"})
    result = last(HeldWords(), far, far, far, said({"P2": "far", "P4": "near"}))
    assert result.obstacles["layer1"] == {"P2": "far", "P4": "near"}
    assert "in near distance" in result.sentence
    nearer = last(HeldWords(), far, far, said({"P2": "near"}))
    assert nearer.obstacles["layer1"] == {"P2": "near"}
    undecided = last(HeldWords(), far, said({"P1": "far"}), said({"P1": "middle"}))
    assert undecided.obstacles["layer1"] == {"P1": "middle"}


def test_regions_are_held_together_until_most_pairs_show_others() -> None:
    held, one, both = HeldWords(), said({"P2": "far"}), said({"P2": "far", "P1": "far"})
    # what is said of one region is true of a pair that shows another as well
    assert last(held, one, one, one, both, both).obstacles["layer1"] == {"P2": "far"}
    assert last(held, both, both).obstacles["layer1"] == {"P1": "far", "P2": "far"}
    # an object that is gone is not said any more when three of five pairs lack it
    none = said({})
    assert last(held, none, none).obstacles["layer1"] == {"P1": "far", "P2": "far"}
    assert last(held, none).obstacles["layer1"] == {}


def test_no_object_is_held_where_the_floor_is_seen() -> None:
    near, label = said({"P2": "far", "P4": "near"}), SEEN.label.copy()
    rows, cols = label.shape
    label[rows // 2 :, cols // 2 :] = Label.FLOOR
    floor = replace(said(None), label=label)
    assert last(HeldWords(), near, floor).obstacles["layer1"] == {"P2": "far"}
    assert last(HeldWords(), near, floor, said(None)).obstacles["layer1"] == {"P2": "far"}
    stands = replace(near, label=label)
    assert last(HeldWords(), near, stands).obstacles["layer1"] == {"P2": "far", "P4": "near"}


def test_words_are_held_over_two_pairs_without_a_result_and_not_over_three() -> None:
    wall = said({"P1": "middle"}, "a wall")
    held = HeldWords()
    assert "Front is a wall" in last(held, wall, wall, None, None).sentence
    gone = last(held, None)
    assert "nearest object is unknown" in gone.sentence
    assert "Front is unknown" in gone.sentence
    assert gone.obstacles["layer1"] == {}


def test_another_scene_begins_without_the_words_of_the_last() -> None:
    held = HeldWords()
    last(held, said({"P1": "near"}, "a wall"), said({"P1": "near"}, "a wall"))
    held.interrupt()
    result = last(held, said({"P3": "far"}))
    assert result.obstacles["layer1"] == {"P3": "far"}
    assert "Front is unknown" in result.sentence


@given(
    st.lists(st.none() | st.dictionaries(st.sampled_from(QUADRANTS), TERMS).map(said), max_size=12)
)
def test_layers_never_contradict_each_other(percepts: list[Percept | None]) -> None:
    held = HeldWords()
    for percept in percepts:
        result = last(held, percept)
        first, second = result.obstacles["layer1"], result.obstacles["layer2"]
        assert {name[1:3] for name in second} == set(first)
        assert all(first[name[1:3]] == term for name, term in second.items())
        assert ("unknown" in result.sentence.split(";")[0]) <= (not first)


@pytest.mark.parametrize("known", [True, False])
def test_the_figures_of_a_percept_stay(*, known: bool) -> None:
    held = HeldWords().hold(said({"P1": "near"}), known=known)
    assert np.array_equal(held.nearness, SEEN.nearness)
    assert held.situations == SEEN.situations
