"""Labels of real frames, and the judgement of a sentence by them (docs/real-frames.md)."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from navfw.config.input_file import max_bytes, read_input_text
from navfw.offis.percept_explanation import front_in

QUADRANTS = {"P1": "upper_right", "P2": "upper_left", "P3": "lower_left", "P4": "lower_right"}
"""Names in the labels of the quadrants of layer 1."""

_FRONTS = frozenset({"wall", "door", "corner", "corridor", "open"})
"""Names in the labels of the fronts: the last words of theirs, such as "left slope wall"."""

_SETS = ("nearest", "nearest_also", "front_also")
"""Columns with any number of names."""


class SentenceVerdict(StrEnum):
    """What the statements of a sentence are worth together."""

    RIGHT = "right"
    PARTLY = "partly"
    WRONG = "wrong"
    SILENT = "silent"


@dataclass(frozen=True, slots=True)
class FrameLabel:
    """What can be seen in one real frame; the fields are the columns of ``real_frames.csv``.

    ``nearest`` and ``nearest_also`` are quadrants, or ``none`` or ``unknown``; ``front`` and
    ``front_also`` what stands in front; ``single`` tells that the frame has no neighbour for flow.
    """

    part: str
    split: str
    folder: str
    file: str
    single: bool
    nearest: frozenset[str]
    nearest_also: frozenset[str]
    floor_in_front: str
    front: str
    front_also: frozenset[str]


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether each statement of a sentence is true, such as ``nearest``, ``front``, ``floor``."""

    statements: Mapping[str, bool]

    @property
    def verdict(self) -> SentenceVerdict:
        """All statements together."""
        true = sum(self.statements.values())
        if not self.statements:
            return SentenceVerdict.SILENT
        if true == len(self.statements):
            return SentenceVerdict.RIGHT
        return SentenceVerdict.PARTLY if true else SentenceVerdict.WRONG


def load_labels() -> list[FrameLabel]:
    """All labels, in the order of the file."""
    file = Path(__file__).with_name("real_frames.csv")
    text = read_input_text(file, max_bytes("benchmark"))
    return [
        FrameLabel(
            **row
            | {name: frozenset(row[name].split()) for name in _SETS}
            | {"single": row["single"] == "yes"}
        )
        for row in csv.DictReader(text.splitlines(), strict=True)
    ]


def judge(sentence: str, nearest: Mapping[str, str], label: FrameLabel) -> Judgement:
    """The statements of a ``sentence`` judged by ``label``.

    ``nearest`` has the distance term of each quadrant that layer 1 names. What the label leaves
    open is not judged.
    """
    statements = {
        "nearest": _nearest(sentence, nearest, label),
        "front": _front(sentence, label),
        "floor": _floor(sentence, label),
    }
    return Judgement({name: true for name, true in statements.items() if true is not None})


def _nearest(sentence: str, nearest: Mapping[str, str], label: FrameLabel) -> bool | None:
    if label.nearest == {"unknown"}:
        return None
    if "no object in sight" in sentence:
        return label.nearest == {"none"}
    named = {QUADRANTS[quadrant]: term for quadrant, term in nearest.items()}
    if not named:
        return None
    if label.nearest == {"none"}:
        return all(place in label.nearest_also and term == "far" for place, term in named.items())
    return named.keys() <= label.nearest | label.nearest_also


def _front(sentence: str, label: FrameLabel) -> bool | None:
    alternatives = front_in(sentence).split(" or ")
    named = _FRONTS & {name.rpartition(" ")[2] for name in alternatives}
    if not named or label.front == "unknown":
        return None
    return bool(named & (label.front_also | {label.front}))


def _floor(sentence: str, label: FrameLabel) -> bool | None:
    if "Floor in front" not in sentence or label.floor_in_front == "unknown":
        return None
    return label.floor_in_front == "yes"
