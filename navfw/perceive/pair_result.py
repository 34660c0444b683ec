"""Hold the result of a pair of images; convert it to JSON data and to a line of text."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from navfw.numerics import Array
from navfw.offis.elementary_situations import ELEMENTARY, TABLE
from navfw.offis.percept_explanation import front_in
from navfw.perceive.pair_motion import PairMotion, Scale
from navfw.perceive.sentence_evidence import Statement, strongest_term
from navfw.perceive.small_things import SmallThing
from navfw.signals import FlowField, Percept


@dataclass(frozen=True, slots=True)
class PairResult:
    """All values computed from one pair of images.

    ``flow`` is derotated and refers to the working image. ``front`` has the probabilities of the
    surfaces ahead, by this pair only; {} if unknown. ``small`` is None if unknown. ``statements``
    have their evidence. ``focus`` (x, y) is the focus of expansion [px from the top left of the
    original image], None if it is unknown; ``focal`` is the focal length [px of that image].
    ``rotation_vector`` (3,) [rad] is the camera's rotation about base_link's x, y, z (roll, pitch,
    yaw); ``motion`` is the estimate before it is refined by the flow on the grid.

    ``contact`` [s] is the time to contact with the surface straight ahead, ``quadrant_contact`` [s]
    that of the nearest part of each quadrant; both are inf if nothing approaches. ``confidence`` is
    in [0, 1]. If ``known`` is False, this pair shows nothing and ``notes`` give the reason: the
    words of the percept are then those held from earlier pairs, or unknown.
    """

    number: int
    past: str
    now: str
    time: float
    motion: PairMotion
    scale: Scale
    flow: FlowField
    percept: Percept
    front: dict[str, float]
    small: tuple[SmallThing, ...] | None
    statements: tuple[Statement, ...]
    rotation_vector: Array
    focus: tuple[float, float] | None
    focal: float
    contact: float
    quadrant_contact: dict[str, float]
    confidence: float
    known: bool
    notes: tuple[str, ...]


_DIGITS = 4


def as_data(result: PairResult) -> dict[str, Any]:
    """Convert the result of a pair of images to JSON data; undefined numbers are None.

    Distances in metres are None if the scale is unknown; times to contact [s] need no scale.
    Positions are in pixels from the top left of the original images.
    """
    percept, scale = result.percept, result.scale
    front = front_in(percept.sentence)
    regions = percept.explanation["regions"]
    focus = None if result.focus is None else {"x": _n(result.focus[0]), "y": _n(result.focus[1])}
    roll, pitch, yaw = (math.degrees(angle) for angle in result.rotation_vector)
    return {
        "pair": result.number,
        "time": _n(result.time),
        "dt": _n(result.motion.dt),
        "frames": [result.past, result.now],
        "sentence": percept.sentence,
        "statements": [_statement(one) for one in result.statements],
        "small_things": None if result.small is None else [_thing(one) for one in result.small],
        "known": result.known,
        "confidence": _n(result.confidence),
        "obstacles": {layer: dict(parts) for layer, parts in percept.obstacles.items()},
        "distances": {
            name: {
                "term": strongest_term(degrees),
                **{term: _n(degree) for term, degree in degrees.items()},
                "distance_m": _n(1.0 / near) if scale.metric and near > 0.02 else None,
                "ttc_s": _n(result.quadrant_contact[name]),
            }
            for name, degrees in percept.quadrants.items()
            for near in (regions[name]["nearest"],)
        },
        # "open", an entry of Table 1 or an elementary situation
        "situation": front if front in (*TABLE, *ELEMENTARY, "open") else "unknown",
        "front": {name: _n(probability) for name, probability in result.front.items()},
        "situations": {name: _n(degree) for name, degree in percept.situations.items()},
        "floor_in_front": _n(percept.floor_in_front),
        "slopes": dict(percept.slopes),
        "planes": {pair: _n(degree) for pair, degree in percept.planes.items()},
        "ttc_s": _n(result.contact),
        "heading": _heading(result),
        "focus_of_expansion": focus,
        "rotation_deg": {
            "yaw": _n(yaw),
            "pitch": _n(pitch),
            "roll": _n(roll),
            "source": result.motion.turn_source,
        },
        "scale": {
            "source": scale.source,
            "speed_m_s": _n(scale.speed) if scale.metric else None,
            "camera_height_m": _n(scale.height) if scale.metric and scale.floor else None,
        },
        "notes": list(result.notes),
    }


def _statement(one: Statement) -> dict[str, Any]:
    probability, age = _n(one.probability), _n(one.age)
    return {"what": one.what, "says": one.says, "probability": probability, "age_s": age}


def _thing(one: SmallThing) -> dict[str, Any]:
    sizes = {name: _n(getattr(one, name)) for name in ("distance", "width", "height")}
    bearing, box = _n(math.degrees(one.bearing)), [_n(share) for share in one.box]
    return {**sizes, "bearing_deg": bearing, "box": box}


def as_line(result: PairResult) -> str:
    """Format time, confidence, time to contact and the sentence, the front first, as a line."""
    contact = f"{result.contact:6.1f} s" if math.isfinite(result.contact) else "       -"
    clauses = result.percept.sentence.split("; ")
    sentence = "; ".join(sorted(clauses, key=lambda clause: clause.startswith("Layer")))
    notes = f" ({'; '.join(result.notes)})" if result.notes else ""
    return f"{result.time:8.2f} s  {result.confidence:4.2f}  {contact}  {sentence}{notes}"


def _heading(result: PairResult) -> dict[str, Any]:
    """Return kind of motion; the heading in the camera's axes, and its standard deviation."""
    egomotion = result.motion.egomotion
    has_heading = math.isfinite(egomotion.heading_sigma)
    right, down, ahead = egomotion.direction.tolist()
    bearing, elevation = math.atan2(-right, ahead), math.asin(min(max(-down, -1.0), 1.0))
    return {
        "motion": str(egomotion.kind),
        "bearing_deg": _n(math.degrees(bearing)) if has_heading else None,
        "elevation_deg": _n(math.degrees(elevation)) if has_heading else None,
        "sigma_deg": _n(math.degrees(egomotion.heading_sigma)),
    }


def _n(value: float) -> float | None:
    return round(float(value), _DIGITS) if math.isfinite(value) else None
