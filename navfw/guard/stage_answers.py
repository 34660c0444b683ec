"""Checks of what each stage returns to the stack.

Each function takes the answer and, where needed, what it must agree with, returns it checked
(``navfw.guard.answers``), and raises ``AnswerError``. A field is checked by its name (``_CHECKS``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from navfw.errors import did_you_mean
from navfw.guard import answers
from navfw.guard.answer_kernels import are_finite_where, is_symmetric
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
    Waypoint,
)

if TYPE_CHECKING:
    from navfw.topomap import Passage, TopoMap

T = TypeVar("T")

QUADRANTS = ("P1", "P2", "P3", "P4")
_TERMS = ("near", "middle", "far")
_LABELS = (int(min(Label)), int(max(Label)))
_INT8 = np.dtype(np.int8)
_UNKNOWN = int(Label.UNKNOWN)


def check_proposal(answer: Any, shape: tuple[int, int]) -> Proposal:
    """Check a behaviour's proposal for a command grid of ``shape`` (n_v, n_w)."""
    answers.instance(answer, Proposal, "propose")
    if not callable(answer.explain):
        raise answers.AnswerError("explain is no function")
    layers = ("desirability", "prohibition")
    checked = {name: answers.degrees(getattr(answer, name), name, shape) for name in layers}
    return _checked(answer, Proposal, explain=answer.explain, **checked)


def check_weights(answer: Any, known: Collection[str] = ()) -> dict[str, float]:
    """Check a composite's weights of primitives; if ``known`` is given, only of these."""
    weights = answers.mapping(answer, "weigh's answer")
    if known and (unknown := next((name for name in weights if name not in known), None)):
        near = did_you_mean(str(unknown), known)
        raise answers.AnswerError(f"weighs {unknown!r}, which is no behaviour: {near}")
    return {name: answers.degree(weight, f"weight of {name}") for name, weight in weights.items()}


def check_command(answer: Any) -> Command:
    """Check a fusion's command."""
    return _checked(answers.instance(answer, Command, "fuse"), Command)


def check_flow(answer: Any, pair: FramePair) -> FlowField:
    """Check a flow processor's field of ``pair``; its motion is replaced by that of ``pair``.

    ``sigma`` may be infinite where the confidence is 0.
    """
    answers.instance(answer, FlowField, "compute")
    shape = np.shape(answer.confidence)
    if len(shape) != 2 or 0 in shape:
        raise answers.AnswerError(f"confidence has shape {shape}, expected (rows, cols)")
    confidence = answers.degrees(answer.confidence, "confidence", shape)
    hints = answer.inconsistency
    return _checked(
        answer,
        FlowField,
        points=answers.array(answer.points, "points", (*shape, 2)),
        vectors=answers.array(answer.vectors, "vectors", (*shape, 2)),
        confidence=confidence,
        sigma=_finite_where(answer.sigma, "sigma", shape, confidence, 0.0),
        motion=pair.motion,
        inconsistency=None if hints is None else answers.degrees(hints, "inconsistency", shape),
    )


def check_percept(answer: Any, flow: FlowField) -> Percept:
    """Check a perception's percept on the grid of ``flow``.

    Nearness and sigma may be infinite where the confidence is 0, height where the label is UNKNOWN.
    """
    answers.instance(answer, Percept, "perceive")
    shape = flow.shape
    confidence = answers.degrees(answer.confidence, "confidence", shape)
    label = np.asarray(answer.label)
    if label.dtype.kind not in "iu" or label.shape != shape:
        raise answers.AnswerError(
            f"label is {label.dtype} of shape {label.shape}, expected int8, {shape}"
        )
    if label.min() < _LABELS[0] or label.max() > _LABELS[1]:
        raise answers.AnswerError(f"label has values outside [{_LABELS[0]}, {_LABELS[1]}]")
    labelled = confidence * (label != _UNKNOWN)
    return _checked(
        answer,
        Percept,
        points=answers.array(answer.points, "points", (*shape, 2)),
        nearness=_finite_where(answer.nearness, "nearness", shape, confidence),
        sigma=_finite_where(answer.sigma, "sigma", shape, confidence, 0.0),
        confidence=confidence,
        height=_finite_where(answer.height, "height", shape, labelled),
        label=answers.contiguous(label, _INT8),
    )


def _detection(mark: LandmarkDetection) -> LandmarkDetection:
    return _checked(mark, LandmarkDetection, covariance=_covariance(mark.covariance, 2))


def check_belief(answer: Any) -> Belief:
    """Check a localiser's belief."""
    answers.instance(answer, Belief, "update")
    return _checked(answer, Belief, covariance=_covariance(answer.covariance, 3))


def check_waypoint(answer: Any) -> Waypoint | None:
    """Check a planner's waypoint, or None when the mission has ended."""
    return None if answer is None else _waypoint(answers.instance(answer, Waypoint, "update"))


@lru_cache(maxsize=4096)  # a planner gives the same waypoints at every frame
def _waypoint(answer: Waypoint) -> Waypoint:
    passage = None if answer.passage is None else _two_names(answer.passage, "passage")
    return _checked(answer, Waypoint, passage=passage)


@lru_cache(maxsize=4096)
def _query(answer: PassageQuery) -> PassageQuery:
    return _checked(answer, PassageQuery)


def _each(answer: Any, cls: type[T], call: str, check: Callable[[T], T]) -> tuple[T, ...]:
    """Return the items of an answer, each a ``cls`` that is checked."""
    items = answers.items(answer, f"{call}'s answer")
    return tuple(check(answers.instance(item, cls, call)) for item in items)


check_twist = partial(answers.twist, what="control's answer")
check_detections = partial(_each, cls=LandmarkDetection, call="recognize", check=_detection)
check_path = partial(_each, cls=Waypoint, call="path", check=_waypoint)
check_queries = partial(_each, cls=PassageQuery, call="queries", check=_query)
check_wish = partial(answers.instance, cls=bool, call="wants_grid")
"""Checks of what a controller, a feature recogniser and a planner return."""


def check_reason(answer: Any) -> str | None:
    """Check a planner's reason why there is no route, or its notes; None while there is none."""
    return None if answer is None else answers.text(answer, "no_route_reason")


Findings: TypeAlias = (
    "tuple[Sequence[Passage], Sequence[tuple[str, Sequence[Any]]], TopoMap | None]"
)


def check_findings(answer: Any) -> Findings:
    """Check a planner's findings: closed passages, ways with tracks (none empty), a map or None."""
    from navfw.topomap import Passage, TopoMap  # not at the top: whoever asks why needs no graphs

    closed = _each(answer[0], Passage, "closed", lambda passage: passage)
    ways = [_pair(way, "found", lambda part, _: part, "parts") for way in answer[1]]
    tracks = [(answers.text(n, "found"), [_point(at, "track") for at in t]) for n, t in ways if t]
    return closed, tracks, answer[2] and answers.instance(answer[2], TopoMap, "topo_map")


def _count(value: Any, what: str) -> int:
    return int(answers.number(value, what, 0.0))


def _explanation(value: Any, what: str) -> Mapping[str, Any]:
    """Return a mapping as it is: it may be computed on request."""
    if not isinstance(value, Mapping):
        raise answers.AnswerError(f"{what} is no mapping")
    return value


check_explanation = partial(_explanation, what="explain_choice")


def _finite_where(
    value: Any, what: str, shape: tuple[int, int], confidence: Array, low: float = -math.inf
) -> Array:
    """Return an array that is at least ``low``, and finite wherever the confidence is not 0."""
    result = answers.real(value, what, shape)
    if not are_finite_where(result, confidence, low):
        below = "" if math.isinf(low) else f"below {low:g} or "
        raise answers.AnswerError(f"{what} has values that are {below}not finite")
    return result


def _covariance(value: Any, size: int) -> Array:
    covariance = answers.array(value, "covariance", (size, size))
    if min(covariance.diagonal().tolist()) < 0.0:
        raise answers.AnswerError("covariance has a negative variance")
    if not is_symmetric(covariance):
        raise answers.AnswerError("covariance is not symmetric")
    return covariance


_numbers = partial(answers.mapping_of, check=answers.number)
_texts = partial(answers.mapping_of, check=answers.text)


def _quadrants(value: Any, what: str) -> Mapping[str, Mapping[str, float]]:
    """Degrees of near, middle and far for each quadrant, the four of the image among them."""
    quadrants = answers.mapping_of(value, what, _numbers)
    for name in QUADRANTS:
        degrees_by_term = quadrants.get(name, {})
        for term in _TERMS:
            if term not in degrees_by_term:
                raise answers.AnswerError(f"quadrants has no {name}.{term}")
    return quadrants


def _width(value: Any, what: str) -> float:
    return math.inf if value == math.inf else answers.number(value, what, 0.0)


def _pair(value: Any, what: str, check: Callable[[Any, str], T], names: str) -> tuple[T, T]:
    pair = answers.items(value, what)
    if len(pair) != 2:
        raise answers.AnswerError(f"{what} has {len(pair)} {names}")
    return check(pair[0], what), check(pair[1], what)


_two_names = partial(_pair, check=answers.text, names="names, expected 2")
_point = partial(_pair, check=answers.number, names="numbers, expected x and y")

_CHECKS: Mapping[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("time", "x", "y", "bearing"), answers.number),
    **dict.fromkeys(("range", "tolerance"), partial(answers.number, low=0.0)),
    **dict.fromkeys(("applicability", "confidence", "floor_in_front"), answers.degree),
    **dict.fromkeys(("reason", "leader", "sentence", "identity", "place", "kind"), answers.text),
    **dict.fromkeys(("emergency", "derotated", "lost", "final"), lambda value, _: bool(value)),
    **dict.fromkeys(("weights", "planes"), _numbers),
    **dict.fromkeys(("places", "situations"), partial(answers.mapping_of, check=answers.degree)),
    **dict.fromkeys(("start", "end"), _point),
    **dict.fromkeys(("updates", "hypotheses"), _count),
    "twist": answers.twist,
    "pose": answers.pose,
    "slopes": _texts,
    "obstacles": partial(answers.mapping_of, check=_texts),
    "quadrants": _quadrants,
    "explanation": _explanation,
    "normal": lambda value, what: None if value is None else _point(value, what),
    "width": _width,
    "passage": _two_names,
}
"""The check of each field by its name, where it does not depend on other fields."""


def _checked(answer: Any, cls: type[T], **checked: Any) -> T:
    """Return ``answer`` as a ``cls``; fields that are not ``checked`` before are by ``_CHECKS``."""
    names = (name for name in _names_of(cls) if name not in checked)  # type: ignore[arg-type]
    values = {name: _CHECKS[name](getattr(answer, name), name) for name in names}
    return answers.rebuilt(answer, cls, **values, **checked)


@lru_cache
def _names_of(cls: Any) -> list[str]:
    return sorted(field.name for field in fields(cls))
