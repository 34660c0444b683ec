from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.reproduce import paper_tables, reproduction


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the comparison of metrics, which has tests of its own and takes a while."""
    shares = {"quadrant": 1.0, "distance": 1.0, "situation": 1.0}
    both = {"ideal": shares, "block matching": shares}

    def compare(views: int, seed: int) -> dict[str, object]:
        numbers = {"L=2, means": both, "L=1, means and variances": both}
        return {"views": views, "clear": 1, "seed": seed, "offis": {"a": both}, "numbers": numbers}

    monkeypatch.setattr(reproduction, "compare_metrics", compare)
    monkeypatch.setattr(reproduction, "timings", partial(paper_tables.timings, repeats=2))


@pytest.mark.usefixtures("quick")
def test_reproduce(tmp_path: Path) -> None:
    out = tmp_path / "page"
    done = CliRunner().invoke(app, ["reproduce", "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert all(result["checks"].values())
    assert result["timings"]["paper"]["obstacles_s"] == 0.16
    written = {path.name for path in out.iterdir()}
    numbers = [row["waypoint"] for row in result["table2"]]
    assert written == {
        *("index.md", "result.json", "map.png"),
        *(f"waypoint-{n}.png" for n in numbers),
        *(f"scene-{n}.png" for n in (1, 2, 3)),
    }
    assert list(tmp_path.iterdir()) == [out]
    assert json.loads((out / "result.json").read_text())["digest"] == result["digest"]


def test_reproduce_leaves_other_folders_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("work")
    done = CliRunner().invoke(app, ["reproduce", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "contains 'thesis.txt', so it is not replaced; choose another --out" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
