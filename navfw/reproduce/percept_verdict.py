"""Judgement of a rendered view's percept: nearest object, its distance, and what is in front.

The front is judged at every view. Where the walls form one of the situations of the paper's Table
1, a true one has to be named. Where they form none, or furniture hides them, Table 1's "unknown" is
right, and so is what the walls form with wider limits (``ViewTruth.possible_situations``).
"""

from __future__ import annotations

import math

from navfw.bench.real_labels import Judgement
from navfw.bench.view_truth import DOMINANT, HIDDEN, ViewTruth
from navfw.offis.elementary_situations import TABLE
from navfw.offis.nearness import TERMS
from navfw.signals import Percept


def judge_percept(percept: Percept, truth: ViewTruth) -> Judgement:
    """The statements ``nearest``, ``distance`` and ``front`` of a ``percept``."""
    quadrant, distance, front = check_percept(percept, truth)
    if front is None:
        named = set(front_of(percept).split(" or "))
        front = bool(named & {"unknown", *truth.possible_situations})
    return Judgement({"nearest": quadrant, "distance": distance, "front": front})


def check_percept(percept: Percept, truth: ViewTruth) -> tuple[bool, bool, bool | None]:
    """Whether nearest quadrants, distance term and situation in front are correct.

    Every named quadrant must be possible and at least one certain; the situation must be a true
    one, and is None where the walls form none. ``navfw.bench.view_truth`` defines the truth.
    """
    named = percept.obstacles["layer1"]
    quadrant = bool(named.keys() & truth.certain) and named.keys() <= truth.possible
    term = min(named.values(), key=TERMS.index) if named else "none"
    distance = term == truth.term or (term == "none" and truth.term == "far")
    front = None
    if truth.clear:
        front = any(name in truth.situations for name in front_of(percept).split(" or "))
    return quadrant, distance, front


def front_of(percept: Percept) -> str:
    """The situation in front by the percept's sentence: an entry of Table 1, or "door"."""
    for part in percept.sentence.split("; "):
        if part.startswith("Front is "):
            return part.removeprefix("Front is ").removeprefix("a ")
    return max(TABLE, key=percept.situations.__getitem__)


def no_situation(truth: ViewTruth) -> str | None:
    """Why the view shows none of Table 1's situations, with figures; None where it shows one."""
    if truth.clear:
        return None
    possible = truth.possible_situations
    nearly = "" if possible == ("mixed",) else f" (possible: {' and '.join(possible)})"
    halves = ("left", "right")
    if truth.situations == ("hidden",):
        shares = [
            f"{share:.0%} of the walls in the {side} half"
            for side, share in zip(halves, truth.hidden, strict=True)
            if share > HIDDEN
        ]
        return f"furniture hides {' and '.join(shares)}{nearly}"
    small = [
        f"{plane.share:.0%} of the {side} half"
        for side, plane in zip(halves, truth.planes, strict=True)
        if plane.share < DOMINANT
    ]
    if small:
        return f"the largest wall fills {' and '.join(small)}, less than {DOMINANT:.0%}{nearly}"
    slopes = [
        f"{side} {math.degrees(plane.slope):.0f} deg"
        for side, plane in zip(halves, truth.planes, strict=True)
    ]
    return f"the walls are aslant by {' and '.join(slopes)}, which is no pair of Table 1{nearly}"
