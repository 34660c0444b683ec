"""The labels of real frames: form, amount, splits (docs/real-frames.md). No picture is needed."""

from __future__ import annotations

import csv
import itertools
import re
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
QUADRANTS = {"upper_left", "upper_right", "lower_left", "lower_right"}
FRONTS = {"wall", "corner", "corridor", "door", "object", "open", "unknown"}
COLUMNS = [
    "part",
    "split",
    "folder",
    "file",
    "single",
    "nearest",
    "nearest_also",
    "floor_in_front",
    "front",
    "front_also",
]


def rows() -> list[dict[str, str]]:
    with (ROOT / "navfw/bench/real_frames.csv").open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file, strict=True)
        found = list(reader)
    assert reader.fieldnames == COLUMNS
    return found


def test_every_label_is_one_of_the_rule() -> None:
    for row in rows():
        nearest, also = row["nearest"].split(), row["nearest_also"].split()
        assert nearest in (["none"], ["unknown"]) or set(nearest) <= QUADRANTS, row
        assert nearest, row
        assert set(also) <= QUADRANTS - set(nearest), row
        assert len(nearest + also) == len(set(nearest + also)), row
        front_also = row["front_also"].split()
        assert row["front"] in FRONTS, row
        assert set(front_also) <= FRONTS - {"unknown", row["front"]}, row
        assert len(front_also) == len(set(front_also)), row
        assert row["floor_in_front"] in {"yes", "no", "unknown"}, row
        assert row["split"] in {"tuning", "test"}, row
        assert row["single"] == ("yes" if row["folder"] == "corridor_udes" else "no"), row
        assert re.fullmatch(r"[\w.]+\.(jpg|png)", row["file"]), row
        assert re.fullmatch(r"\w+(/\w+)*", row["folder"]), row


def test_there_are_200_frames_and_none_twice() -> None:
    frames = [(row["folder"], row["file"]) for row in rows()]
    assert len(set(frames)) == len(frames) >= 200


def test_a_part_belongs_to_one_split_and_one_folder() -> None:
    homes = defaultdict(set)
    for row in rows():
        homes[row["part"]].add((row["split"], row["folder"]))
    assert {part: home for part, home in homes.items() if len(home) > 1} == {}


def test_parts_of_different_splits_are_ten_frames_apart() -> None:
    numbers = defaultdict(list)
    for row in rows():
        if row["single"] == "no" and row["part"] != "tum":
            digits = re.search(r"\d+", row["file"])
            assert digits is not None, row
            numbers[row["folder"]].append((int(digits[0]), row["split"]))
    close = [
        (folder, one, other)
        for folder, frames in numbers.items()
        for one, other in itertools.pairwise(sorted(frames))
        if one[1] != other[1] and other[0] - one[0] < 10
    ]
    assert close == []


def test_both_splits_have_every_case_on_sequences() -> None:
    for split in ("tuning", "test"):
        moving = [row for row in rows() if row["split"] == split and row["single"] == "no"]
        fronts = {row["front"] for row in moving}
        assert {"wall", "corridor", "object", "open"} <= fronts
        assert {"yes", "no"} <= {row["floor_in_front"] for row in moving}
        nearest = set(" ".join(row["nearest"] for row in moving).split())
        assert nearest >= QUADRANTS


def test_the_page_lists_all_parts_with_their_split() -> None:
    page = (ROOT / "docs/real-frames.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| `(\w+)` \| `([\w/]+)` \| .* \| (\w+) \|$", page, re.MULTILINE))
    assert listed == {(row["part"], row["folder"], row["split"]) for row in rows()}
