"""Sentences on real frames judged by labels; the benchmark on pictures made here."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from perceive_images import label, save, save_approach, texture
from typer.testing import CliRunner

from navfw.bench import RECORDINGS, SentenceVerdict, bench_real, judge, load_labels, real_benchmark
from navfw.cli import app
from navfw.errors import ConfigError
from navfw.plugins import default_registry

SEEN = "Layer1: nearest object is on upper left in near distance; Front is a {}"


@pytest.mark.parametrize(
    ("sentence", "nearest", "truth", "verdict"),
    [
        (
            SEEN.format("door or corridor") + "; Floor in front",
            {"P2": "near"},
            {},
            SentenceVerdict.RIGHT,
        ),
        (SEEN.format("wall") + "; Floor in front", {"P2": "near"}, {}, SentenceVerdict.PARTLY),
        (SEEN.format("wall"), {"P1": "near"}, {}, SentenceVerdict.WRONG),
        (SEEN.format("left slope wall or unknown"), {"P2": "near"}, {"front": "wall"}, "right"),
        (
            SEEN.format("wall"),
            {"P1": "near"},
            {"also": "upper_right", "front_also": "wall"},
            "right",
        ),
        ("Layer1: no object in sight; Front is unknown", {}, {}, SentenceVerdict.WRONG),
        (
            "Layer1: no object in sight; Front is unknown",
            {},
            {"nearest": "none"},
            SentenceVerdict.RIGHT,
        ),
        ("Layer1: no object in sight; Front is unknown", {}, {"nearest": "unknown"}, "silent"),
        ("Layer1: nearest object is unknown; Front is unknown", {}, {}, SentenceVerdict.SILENT),
        ("Front is unknown; Floor in front", {}, {"floor": "no"}, SentenceVerdict.WRONG),
        ("Front is unknown; Floor in front", {}, {"floor": "unknown"}, SentenceVerdict.SILENT),
        ("", {"P2": "far"}, {"nearest": "none", "also": "upper_left"}, SentenceVerdict.RIGHT),
        ("", {"P2": "near"}, {"nearest": "none", "also": "upper_left"}, SentenceVerdict.WRONG),
        ("Front is a door", {}, {"front": "open"}, SentenceVerdict.WRONG),
        ("Front is a door", {}, {"front": "unknown"}, SentenceVerdict.SILENT),
    ],
)
def test_a_sentence_is_judged_by_the_rule(
    sentence: str, nearest: dict[str, str], truth: dict[str, str], verdict: str
) -> None:
    assert judge(sentence, nearest, label(**truth)).verdict == verdict


def test_the_labels_are_read_and_their_cameras_are_known() -> None:
    labels = load_labels()
    assert len(labels) > 240
    assert {frame.folder for frame in labels} == set(RECORDINGS)


@pytest.fixture
def approach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of recordings with one approach to a wall, and labels for two of its frames."""
    labels = save_approach(tmp_path)
    monkeypatch.setattr(real_benchmark, "load_labels", lambda: labels)
    return tmp_path


def rows_of(result: dict[str, Any]) -> list[list[str]]:
    (table,) = real_benchmark.tables(result)
    assert all(len(row) == len(table.head) for row in table.rows)
    return table.rows


@pytest.mark.thorough
def test_the_benchmark_counts_verdicts_and_headings(approach: Path) -> None:
    result = bench_real(approach, "tuning", ["dis"], default_registry())
    assert result["frames"] == 2
    row = result["flows"]["dis"]["parts"]["approach, a"]
    assert row["verdicts"]["right"] == 2, row
    assert row["statements"] == {"front right": 2, "nearest right": 2}
    assert row["pairs"] == 4
    assert rows_of(result)[-1][:6] == ["dis", "all", "2", "0", "0", "0"]
    assert bench_real(approach, "test", ["dis"], default_registry())["frames"] == 0


def test_photographs_without_a_neighbour_are_not_in_the_total(
    approach: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = [texture(seed)[: 3 * 80, : 4 * 80] for seed in range(1, 5)]
    save(approach / "corridor_udes", views)
    single = replace(label(), part="corridor_a", folder="corridor_udes", single=True)
    labels = [label(front="wall", file="image_5.png"), single]
    monkeypatch.setattr(real_benchmark, "load_labels", lambda: labels)
    result = bench_real(approach, "tuning", ["dis"], default_registry())
    assert result["frames"] == 1
    found = result["flows"]["dis"]
    assert sum(found["total"]["verdicts"].values()) == 1
    assert list(found["singles"]) == ["corridor_a"]
    assert found["singles"]["corridor_a"]["verdicts"]["silent"] == 1
    assert rows_of(result)[-1][:2] == ["dis", "corridor_a (single)"]


def test_what_is_missing_is_named(approach: Path) -> None:
    with pytest.raises(ConfigError, match="no such folder"):
        bench_real(approach / "nowhere", "all", ["dis"], default_registry())
    (approach / "approach" / "image_5.png").unlink()
    with pytest.raises(ConfigError, match="labelled image is missing"):
        bench_real(approach, "all", ["dis"], default_registry())


def test_the_command(approach: Path) -> None:
    options = ["bench", "real", "--data", str(approach), "--split", "tuning", "--flow", "dis"]
    done = CliRunner().invoke(app, [*options, "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["flows"]["dis"]["total"]["verdicts"]["right"] == 2
    assert "approach, a" in CliRunner().invoke(app, options).stdout
    wrong = CliRunner().invoke(app, ["bench", "real", "--data", str(approach), "--split", "x"])
    assert wrong.exit_code == 2
    assert "--split" in wrong.stderr
