"""Checks of answers: right ones come out equal, and of wrong ones nothing unsound comes out."""

import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from navfw.guard import answers, stage_answers
from navfw.guard.answers import AnswerError
from navfw.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    FramePair,
    LandmarkDetection,
    PassageQuery,
    Pose,
    Proposal,
    Twist,
    Waypoint,
)
from navfw.testing.behavior_scenes import wall_flow

ROBOT = RobotModel()
FLOW = wall_flow(ROBOT, 0.0, 2.0, 20.0, 20.0)
IMAGE: Any = None
PAIR = FramePair(IMAGE, IMAGE, FLOW.motion)
LAYER = np.linspace(0.0, 1.0, 15).reshape(3, 5)
WAYPOINT = Waypoint(1.0, 2.0, 0.3, "a", "door", False, 0.9, ("a", "b"))
TWIST = Twist(0.2, -0.1)

CHECKED: dict[str, tuple[object, Callable[[Any], object]]] = {
    "flow": (FLOW, partial(stage_answers.check_flow, pair=PAIR)),
    "percept": (
        Offis(ROBOT).perceive(FLOW, Twist(0.3, 0.0)),
        partial(stage_answers.check_percept, flow=FLOW),
    ),
    "detection": (
        LandmarkDetection(0.0, "aruco-1", 0.1, 2.0, np.eye(2)),
        lambda answer: stage_answers.check_detections([answer])[0],
    ),
    "belief": (
        Belief(1.0, Pose(1.0, 2.0, 3.0), np.eye(3), {"a": 0.5}, 0.9, updates=3),
        stage_answers.check_belief,
    ),
    "waypoint": (WAYPOINT, stage_answers.check_waypoint),
    "path": (WAYPOINT, lambda answer: stage_answers.check_path((answer,))[0]),
    "query": (
        PassageQuery(("a", "b"), (0.0, 1.0), (2.0, 3.0), 0.9, (0.0, 1.0)),
        lambda answer: stage_answers.check_queries([answer])[0],
    ),
    "proposal": (
        Proposal(0.5, LAYER, 1.0 - LAYER, "because"),
        partial(stage_answers.check_proposal, shape=LAYER.shape),
    ),
    "command": (
        Command(1.0, TWIST, "avoid", "near", False, {"avoid": 0.5}, {"desire": 1}),
        stage_answers.check_command,
    ),
    "twist": (TWIST, stage_answers.check_twist),
}
WRONG = (
    *(None, 7, -3.0, math.nan, math.inf, 1j, "text", b"bytes", object()),
    *([1.0, "a"], {"a": math.nan}, {1: 2}),
    np.full(LAYER.shape, 2.0),
    np.full(LAYER.shape, np.nan),
    np.zeros((0, 0)),
    np.zeros(LAYER.shape, complex),
    np.full(LAYER.shape, "a"),
    np.full(LAYER.shape, None),
    np.full(FLOW.shape, np.nan),
    np.full(FLOW.shape, -1.0),
    np.ones((1, 1)),
    WAYPOINT,
)


def unsound(value: object, where: str = "") -> list[str]:
    """What in ``value`` a stage behind the guard could not use."""
    if is_dataclass(value):
        if isinstance(value, Waypoint | PassageQuery):
            value = replace(value, width=1.0)  # may be infinite: no passage
        return [
            bad
            for field in fields(value)
            if field.name not in {"explain", "explanation", "motion"}
            for bad in unsound(getattr(value, field.name), f"{where}.{field.name}")
        ]
    if isinstance(value, np.ndarray):
        finite = np.isfinite(value).all() or where.endswith((".sigma", ".nearness", ".height"))
        right = value.dtype in {np.dtype(np.float64), np.dtype(np.int8)} and finite
        return [] if right and value.flags.c_contiguous else [f"{where}: {value.dtype}"]
    if isinstance(value, Mapping):
        return [bad for name, item in value.items() for bad in unsound(item, f"{where}.{name}")]
    if isinstance(value, tuple):
        return [bad for item in value for bad in unsound(item, where)]
    if isinstance(value, bool | str | None):
        return []
    right = isinstance(value, int | float) and math.isfinite(value)
    return [] if right and type(value) in {int, float} else [f"{where}: {value!r}"]


def same(one: object, other: object) -> bool:
    """Whether two answers are equal, arrays by their values."""
    if isinstance(one, np.ndarray):
        return np.array_equal(one, np.asarray(other), equal_nan=one.dtype.kind == "f")
    if is_dataclass(one) and type(one) is type(other):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return one == other


@pytest.mark.parametrize("kind", CHECKED)
def test_a_right_answer_comes_out_equal_and_immutable(kind: str) -> None:
    answer, check = CHECKED[kind]
    checked = check(answer)
    assert same(answer, checked)
    assert unsound(checked) == []
    assert is_dataclass(answer)
    for field in fields(answer):
        value = getattr(answer, field.name)
        if isinstance(value, np.ndarray):
            assert not getattr(checked, field.name).flags.writeable, field.name


@pytest.mark.parametrize("kind", CHECKED)
def test_of_a_wrong_answer_nothing_unsound_comes_out(kind: str) -> None:
    answer, check = CHECKED[kind]
    refused = 0
    assert is_dataclass(answer)
    assert not isinstance(answer, type)
    for field in fields(answer):
        for wrong in WRONG:
            try:
                checked = check(replace(answer, **{field.name: wrong}))
            except (ValueError, TypeError):
                refused += 1
            else:
                assert unsound(checked) == [], (field.name, wrong)
    assert refused > 4 * len(fields(answer))


@pytest.mark.parametrize("kind", CHECKED)
def test_another_type_is_refused(kind: str) -> None:
    _, check = CHECKED[kind]
    for wrong in (7, "text", (), {}, object()):
        with pytest.raises(AnswerError):
            check(wrong)


def test_lists_and_integers_become_float64() -> None:
    layer = [[0, 1, 0], [1, 0, 1]]
    degrees = answers.degrees(layer, "desirability", (2, 3))
    assert degrees.dtype == np.float64
    assert degrees.tolist() == layer
    assert answers.number(np.float32(0.5), "speed") == 0.5
    assert type(answers.number(1, "speed")) is float


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, -1e-12, 1.0 + 1e-8])
def test_one_wrong_value_makes_a_layer_invalid(wrong: float) -> None:
    layer = np.random.default_rng(1).random((11, 21))
    layer[0, 0], layer[3, 4] = 1.0 + 1e-10, 0.0
    answers.degrees(layer, "desirability", layer.shape)
    for spot in ((0, 0), (5, 7), (10, 20)):
        changed = layer.copy()
        changed[spot] = wrong
        with pytest.raises(AnswerError):
            answers.degrees(changed, "desirability", layer.shape)


def test_covariances_are_symmetric_and_not_negative() -> None:
    belief = Belief(1.0, Pose(0.0, 0.0, 0.0), np.eye(3))
    for wrong in (-np.eye(3), np.triu(np.ones((3, 3)))):
        with pytest.raises(AnswerError, match="covariance"):
            stage_answers.check_belief(replace(belief, covariance=wrong))


def test_a_percept_names_the_four_quadrants() -> None:
    percept, check = CHECKED["percept"]
    quadrants = dict(percept.quadrants)  # type: ignore[attr-defined]
    del quadrants["P3"]
    with pytest.raises(AnswerError, match=r"no P3.near"):
        check(replace(percept, quadrants=quadrants))  # type: ignore[type-var]


@pytest.mark.parametrize("kind", ["percept", "belief", "proposal", "command", "twist", "detection"])
def test_an_answer_that_needs_no_change_is_not_copied(kind: str) -> None:
    answer, check = CHECKED[kind]
    checked = check(answer)
    assert check(checked) is checked


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1.1, -0.1, "a", 1j])
def test_one_wrong_number_makes_a_mapping_invalid(wrong: Any) -> None:
    right = {"a": 0.1, "b": 0.2, "c": 0.3}
    assert answers.mapping_of(MappingProxyType(right), "x", answers.degree) == right
    for name in right:
        for kind in (dict, MappingProxyType):
            with pytest.raises(AnswerError, match="x"):
                answers.mapping_of(kind({**right, name: wrong}), "x", answers.degree)
