"""Explanation of a percept: the sentence, and inputs and fired rules of all its inferences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

from navfw.offis.elementary_situations import FLOOR_IN_FRONT, Situations
from navfw.offis.fuzzy_systems import FuzzyEvaluation
from navfw.offis.grid_geometry import BlindBorders
from navfw.offis.nearness import TERMS, Distances, Planes
from navfw.offis.pyramid import Pyramid, RegionStatistics, position
from navfw.offis.walls import SIDES, Slopes, Walls
from navfw.signals.immutability import Sealed


@dataclass(frozen=True, slots=True)
class OffisResults:
    """Intermediate results of one frame; ``known``: the nearest object could be determined."""

    mode: str
    pyramid: Pyramid
    regions: RegionStatistics
    planes: Planes
    distances: Distances
    obstacles: Mapping[str, Mapping[str, str]]
    known: bool
    borders: BlindBorders
    walls: Walls
    slopes: Slopes
    situations: Situations


class PerceptExplanation(Sealed, Mapping[str, Any]):
    """A read-only mapping to plain data (dicts, lists, strings, floats), computed on access.

    Keys: ``mode``; ``report``, the content of the sentence as data; ``regions``, the statistics of
    each region (METHOD R6); ``walls``, the fitted planes; and the inputs and fired rules (strongest
    first) of the inferences ``plane`` (per pair of neighbouring regions), ``distance`` (per
    region), ``border`` and ``slope`` (per side), ``situation`` and ``front``.
    ``dict(explanation)`` computes all of it.
    """

    def __init__(self, results: OffisResults) -> None:
        self._results = results
        self._seal()

    def __getitem__(self, key: str) -> Any:
        return _PARTS[key](self._results)

    def __iter__(self) -> Iterator[str]:
        return iter(_PARTS)

    def __len__(self) -> int:
        return len(_PARTS)

    def __repr__(self) -> str:
        return f"PerceptExplanation({', '.join(_PARTS)})"


def _report(results: OffisResults) -> dict[str, Any]:
    return {
        "nearest": {layer: dict(regions) for layer, regions in results.obstacles.items()},
        "front": results.situations.front,
        "floor_in_front": results.situations.floor_in_front >= FLOOR_IN_FRONT,
    }


def _regions(results: OffisResults) -> dict[str, dict[str, float]]:
    regions = results.regions
    return {
        name: {f.name: round(float(getattr(regions, f.name)[i]), 4) for f in fields(regions)}
        for i, name in enumerate(results.pyramid.names)
    }


def _plane(results: OffisResults) -> dict[str, Any]:
    planes, names = results.planes, results.pyramid.names
    return {
        f"{names[i]}-{names[j]}": planes.evaluation.explain(k)
        for k, (i, j) in enumerate(planes.pairs)
    }


def _distance(results: OffisResults) -> dict[str, Any]:
    distances, names = results.distances, results.pyramid.names[: results.distances.term.size]
    return {name: distances.evaluation.explain(i) for i, name in enumerate(names)}


def _walls(results: OffisResults) -> dict[str, Any]:
    walls = results.walls
    sides = {
        side: {
            name: round(float(getattr(walls, name)[i]), 4)
            for name in ("incline", "slant", "front", "explained", "support", "step")
        }
        for i, side in enumerate(SIDES)
    }
    return {**sides, "shared": round(walls.shared, 4), "opening": round(walls.opening, 4)}


def _slope(results: OffisResults) -> dict[str, Any]:
    slopes = results.slopes
    return {
        side: {"code": slopes.codes[i], **slopes.evaluation.explain(i)}
        for i, side in enumerate(SIDES)
    }


_PARTS: dict[str, Callable[[OffisResults], Any]] = {  # defined
    "mode": lambda results: results.mode,
    "report": _report,
    "regions": _regions,
    "plane": _plane,
    "distance": _distance,
    "border": lambda r: {side: r.borders.evaluation.explain(i) for i, side in enumerate(SIDES)},
    "walls": _walls,
    "slope": _slope,
    "situation": lambda results: results.situations.table_evaluation.explain(0),
    "front": lambda results: results.situations.front_evaluation.explain(0),
}


def evaluations_of(explanation: PerceptExplanation) -> tuple[FuzzyEvaluation, ...]:
    """Return all fuzzy inferences of the frame, for benchmarks that repeat them."""
    results = explanation._results
    return (
        results.planes.evaluation,
        results.distances.evaluation,
        results.borders.evaluation,
        results.slopes.evaluation,
        results.situations.table_evaluation,
        results.situations.front_evaluation,
    )


def report(
    obstacles: Mapping[str, Mapping[str, str]], front: str, floor_in_front: bool, known: bool
) -> str:
    """Write the report as one sentence in the paper's words (Tables 2 and 3, METHOD R13).

    Layer 1 names all quadrants of the nearest object with one distance, the deeper layers name the
    distance per quadrant: "Layer1: nearest object is on upper right and on upper left in middle
    distance; Layer2: nearest object is on upper right in middle distance and on upper left in
    middle distance; Front is a door; Floor in front". Without ``known``, the nearest object is
    reported as unknown.
    """
    parts = []
    for number, regions in enumerate(obstacles.values(), start=1):
        if not known:
            parts.append(f"Layer{number}: nearest object is unknown")
        elif not regions:
            parts.append(f"Layer{number}: no object in sight")
        else:
            parts.append(f"Layer{number}: nearest object is {_location(number, regions)}")
    parts.append(_front_clause(front))
    if floor_in_front:
        parts.append("Floor in front")
    return "; ".join(parts)


def _front_clause(front: str) -> str:
    return f"Front is {front}" if front in ("unknown", "open") else f"Front is a {front}"


def front_in(sentence: str) -> str:
    """Return the front that a ``report`` names, such as "door or corridor"; "" if it names none."""
    clauses = (part for part in sentence.split("; ") if part.startswith("Front is "))
    return next(clauses, "").removeprefix("Front is ").removeprefix("a ")


def _location(layer: int, regions: Mapping[str, str]) -> str:
    nearest: dict[str, str] = {}
    for region, term in regions.items():
        place = position(region)
        if place not in nearest or TERMS.index(term) < TERMS.index(nearest[place]):
            nearest[place] = term
    if layer == 1:
        term = min(nearest.values(), key=TERMS.index)
        return f"{' and '.join(f'on {place}' for place in nearest)} in {term} distance"
    return " and ".join(f"on {place} in {term} distance" for place, term in nearest.items())
