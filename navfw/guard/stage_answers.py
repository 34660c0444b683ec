"""The check of each stage's answer: what passes between stages.

Each function takes the answer and, where needed, what it must agree with, and raises
``AnswerError``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from navfw.guard.answer_kernels import are_deviations, are_finite_where, are_within, is_symmetric
from navfw.guard.answers import (
    AnswerError,
    array,
    contiguous,
    degree,
    degrees,
    instance,
    items,
    mapping,
    number,
    numbers,
    pose,
    real,
    rebuilt,
    text,
    texts,
    twist,
)
from navfw.numerics import Array
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    FramePair,
    Label,
    LandmarkDetection,
    PassageQuery,
    Percept,
    Proposal,
    Twist,
    Waypoint,
)

T = TypeVar("T")

QUADRANTS = ("P1", "P2", "P3", "P4")
_TERMS = ("near", "middle", "far")
_LABELS = (int(min(Label)), int(max(Label)))
_INT8 = np.dtype(np.int8)
_UNKNOWN = int(Label.UNKNOWN)


def check_proposal(answer: Any, shape: tuple[int, int]) -> Proposal:
    """A behaviour's proposal for a command grid of that shape."""
    instance(answer, Proposal, "propose")
    if not callable(answer.explain):
        raise AnswerError("explain is no function")
    return rebuilt(
        answer,
        Proposal,
        applicability=degree(answer.applicability, "applicability"),
        desirability=degrees(answer.desirability, "desirability", shape),
        prohibition=degrees(answer.prohibition, "prohibition", shape),
        reason=text(answer.reason, "reason"),
        explain=answer.explain,
    )


def check_weights(answer: Any) -> dict[str, float]:
    """A composite's weights of primitives."""
    weights = mapping(answer, "weigh's answer")
    return {name: degree(weight, f"weight of {name}") for name, weight in weights.items()}


def check_command(answer: Any) -> Command:
    """A fusion's command."""
    instance(answer, Command, "fuse")
    return rebuilt(
        answer,
        Command,
        time=number(answer.time, "time"),
        twist=twist(answer.twist, "twist"),
        leader=text(answer.leader, "leader"),
        reason=text(answer.reason, "reason"),
        emergency=bool(answer.emergency),
        weights=numbers(answer.weights, "weights"),
        explanation=_explanation(answer.explanation),
    )


def check_twist(answer: Any) -> Twist:
    """A controller's twist."""
    return twist(answer, "control's answer")


def check_flow(answer: Any, pair: FramePair) -> FlowField:
    """A flow processor's field of ``pair``; the motion is that of the pair.

    ``sigma`` may be infinite where the confidence is 0.
    """
    instance(answer, FlowField, "compute")
    shape = _grid_shape(answer.confidence)
    confidence = degrees(answer.confidence, "confidence", shape)
    hints = answer.inconsistency
    return rebuilt(
        answer,
        FlowField,
        time=number(answer.time, "time"),
        points=array(answer.points, "points", (*shape, 2)),
        vectors=array(answer.vectors, "vectors", (*shape, 2)),
        confidence=confidence,
        sigma=_deviations(answer.sigma, shape, confidence),
        motion=pair.motion,
        derotated=bool(answer.derotated),
        inconsistency=None if hints is None else degrees(hints, "inconsistency", shape),
    )


def check_percept(answer: Any, flow: FlowField) -> Percept:
    """A perception's percept on the grid of ``flow``.

    Nearness and sigma may be anything where the confidence is 0, height where the label is UNKNOWN.
    """
    instance(answer, Percept, "perceive")
    shape = flow.shape
    confidence = degrees(answer.confidence, "confidence", shape)
    label = np.asarray(answer.label)
    if label.dtype.kind not in "iu" or label.shape != shape:
        raise AnswerError(f"label is {label.dtype} of shape {label.shape}, expected int8, {shape}")
    if not are_within(label, *_LABELS):
        raise AnswerError(f"label has values outside [{_LABELS[0]}, {_LABELS[1]}]")
    labelled = confidence * (label != _UNKNOWN)
    return rebuilt(
        answer,
        Percept,
        time=number(answer.time, "time"),
        points=array(answer.points, "points", (*shape, 2)),
        nearness=_finite_where(answer.nearness, "nearness", shape, confidence),
        sigma=_deviations(answer.sigma, shape, confidence),
        confidence=confidence,
        height=_finite_where(answer.height, "height", shape, labelled),
        label=contiguous(label, _INT8),
        obstacles=_of_mappings(answer.obstacles, "obstacles", texts),
        quadrants=_quadrants(answer.quadrants),
        planes=numbers(answer.planes, "planes"),
        slopes=texts(answer.slopes, "slopes"),
        situations=numbers(answer.situations, "situations", 0.0, 1.0),
        floor_in_front=degree(answer.floor_in_front, "floor_in_front"),
        sentence=text(answer.sentence, "sentence"),
        explanation=_explanation(answer.explanation),
    )


def check_detections(answer: Any) -> tuple[LandmarkDetection, ...]:
    """A feature recogniser's landmarks in one image."""
    return tuple(_detection(item) for item in items(answer, "recognize's answer"))


def _detection(answer: Any) -> LandmarkDetection:
    instance(answer, LandmarkDetection, "recognize")
    return rebuilt(
        answer,
        LandmarkDetection,
        time=number(answer.time, "time"),
        identity=text(answer.identity, "identity"),
        bearing=number(answer.bearing, "bearing"),
        range=number(answer.range, "range", 0.0),
        covariance=_covariance(answer.covariance, 2),
    )


def check_belief(answer: Any) -> Belief:
    """A localiser's belief."""
    instance(answer, Belief, "update")
    return rebuilt(
        answer,
        Belief,
        time=number(answer.time, "time"),
        pose=pose(answer.pose, "pose"),
        covariance=_covariance(answer.covariance, 3),
        places=numbers(answer.places, "places", 0.0, 1.0),
        confidence=degree(answer.confidence, "confidence"),
        lost=bool(answer.lost),
        updates=int(number(answer.updates, "updates", 0.0)),
        hypotheses=int(number(answer.hypotheses, "hypotheses", 0.0)),
    )


def check_waypoint(answer: Any) -> Waypoint | None:
    """A planner's waypoint, or None at the end."""
    return None if answer is None else _waypoint(instance(answer, Waypoint, "update"))


@lru_cache(maxsize=4096)  # a planner gives the same waypoints at every frame
def _waypoint(answer: Waypoint) -> Waypoint:
    passage = answer.passage
    return Waypoint(
        number(answer.x, "x"),
        number(answer.y, "y"),
        number(answer.tolerance, "tolerance", 0.0),
        text(answer.place, "place"),
        text(answer.kind, "kind"),
        bool(answer.final),
        _width(answer.width),
        None if passage is None else _two_names(passage),
    )


def check_path(answer: Any) -> tuple[Waypoint, ...]:
    """A planner's waypoints ahead."""
    return tuple(_waypoint(instance(item, Waypoint, "path")) for item in items(answer, "path"))


def check_queries(answer: Any) -> tuple[PassageQuery, ...]:
    """A planner's queries for passages."""
    queries = items(answer, "queries")
    return tuple(_query(instance(item, PassageQuery, "queries")) for item in queries)


@lru_cache(maxsize=4096)
def _query(answer: PassageQuery) -> PassageQuery:
    return PassageQuery(
        _two_names(answer.passage),
        _point(answer.start, "start"),
        _point(answer.end, "end"),
        _width(answer.width),
    )


def check_reason(answer: Any) -> str | None:
    """A planner's reason why there is no route; None while there is one."""
    return None if answer is None else text(answer, "no_route_reason")


def _explanation(value: Any) -> Mapping[str, Any]:
    """A mapping as it is: it may be computed on request."""
    if not isinstance(value, Mapping):
        raise AnswerError("explanation is no mapping")
    return value


def _grid_shape(confidence: Any) -> tuple[int, int]:
    shape = np.shape(confidence)
    if len(shape) != 2 or 0 in shape:
        raise AnswerError(f"confidence has shape {shape}, expected (rows, cols)")
    return shape[0], shape[1]


def _finite_where(value: Any, what: str, shape: tuple[int, int], confidence: Array) -> Array:
    result = real(value, what, shape)
    if not are_finite_where(result, confidence):
        raise AnswerError(f"{what} has values that are not finite")
    return result


def _deviations(value: Any, shape: tuple[int, int], confidence: Array) -> Array:
    """Standard deviations: at least 0, finite wherever the confidence is not 0."""
    result = real(value, "sigma", shape)
    if not are_deviations(result, confidence):
        raise AnswerError("sigma has values that are negative or not finite")
    return result


def _covariance(value: Any, size: int) -> Array:
    covariance = array(value, "covariance", (size, size))
    if min(covariance.diagonal().tolist()) < 0.0:
        raise AnswerError("covariance has a negative variance")
    if not is_symmetric(covariance):
        raise AnswerError("covariance is not symmetric")
    return covariance


def _quadrants(value: Any) -> Mapping[str, Mapping[str, float]]:
    """Degrees of near, middle and far for each quadrant, the four of the image among them."""
    quadrants = _of_mappings(value, "quadrants", numbers)
    for name in QUADRANTS:
        degrees_by_term = quadrants.get(name, {})
        for term in _TERMS:
            if term not in degrees_by_term:
                raise AnswerError(f"quadrants has no {name}.{term}")
    return quadrants


def _of_mappings(
    value: Any, what: str, check: Callable[[Any, str], Mapping[str, T]]
) -> Mapping[str, Mapping[str, T]]:
    """A mapping of texts to mappings, each checked; ``value`` itself if nothing has to change."""
    original = mapping(value, what)
    checked = {name: check(item, name) for name, item in original.items()}
    if type(value) is not MappingProxyType:
        return checked
    for name, item in original.items():
        if checked[name] is not item:
            return checked
    return value


def _width(value: Any) -> float:
    return math.inf if value == math.inf else number(value, "width", 0.0)


def _two_names(value: Any) -> tuple[str, str]:
    names = items(value, "passage")
    if len(names) != 2:
        raise AnswerError(f"passage has {len(names)} names, expected 2")
    return text(names[0], "passage"), text(names[1], "passage")


def _point(value: Any, what: str) -> tuple[float, float]:
    point = items(value, what)
    if len(point) != 2:
        raise AnswerError(f"{what} has {len(point)} numbers, expected x and y")
    return number(point[0], what), number(point[1], what)
