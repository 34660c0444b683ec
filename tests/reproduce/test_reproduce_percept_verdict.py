"""The front of a view is judged everywhere, by wider limits where Table 1 has no situation."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from navfw.bench import HalfPlane, ViewTruth, judge_percept, no_situation
from navfw.signals import Percept

WALL = ViewTruth(
    nearness=(0.5, 0.1, 0.1, 0.1),
    certain=frozenset({"P1"}),
    possible=frozenset({"P1", "P4"}),
    distance=2.0,
    term="middle",
    situations=("wall",),
    possible_situations=("wall",),
    planes=(HalfPlane(0, 0.9, 0.1), HalfPlane(0, 0.9, -0.1)),
    hidden=(0.0, 0.1),
)
NEARLY = replace(
    WALL, situations=("mixed",), planes=(HalfPlane(0, 0.6, 0.0), HalfPlane(0, 0.9, 0.0))
)
NOTHING = replace(NEARLY, possible_situations=("mixed",))
HIDDEN = replace(WALL, situations=("hidden",), hidden=(0.5, 0.1), possible_situations=("corridor",))


def percept(front: str) -> Percept:
    sentence = f"Layer1: nearest object is on upper right in middle distance; Front is a {front}"
    found = SimpleNamespace(sentence=sentence, obstacles={"layer1": {"P1": "middle"}})
    return cast(Percept, found)


@pytest.mark.parametrize(
    ("front", "truth", "right"),
    [
        ("wall", WALL, True),
        ("corner", WALL, False),
        ("unknown", WALL, False),
        ("unknown", NOTHING, True),
        ("left wall or unknown", NOTHING, True),
        ("wall", NOTHING, False),
        ("wall", NEARLY, True),
        ("corner", NEARLY, False),
        ("door or corridor", HIDDEN, True),
        ("door", HIDDEN, False),
    ],
)
def test_the_front_is_judged_at_every_view(front: str, truth: ViewTruth, right: bool) -> None:
    judged = judge_percept(percept(front), truth)
    assert judged.statements == {"nearest": True, "distance": True, "front": right}
    assert judged.verdict == ("right" if right else "partly")


def test_the_reason_names_what_is_missing_with_its_figure() -> None:
    assert no_situation(WALL) is None
    assert no_situation(NEARLY) == (
        "the largest wall fills 60% of the left half, less than 67% (possible: wall)"
    )
    assert no_situation(NOTHING) == "the largest wall fills 60% of the left half, less than 67%"
    assert no_situation(HIDDEN) == (
        "furniture hides 50% of the walls in the left half (possible: corridor)"
    )
    steep = (HalfPlane(0, 0.9, math.radians(70.0)), HalfPlane(1, 0.8, math.radians(-10.0)))
    assert no_situation(replace(NOTHING, planes=steep)) == (
        "the walls are aslant by left 70 deg and right -10 deg, which is no pair of Table 1"
    )
