from __future__ import annotations

import json
from pathlib import Path

import pytest
from perceive_images import save_approach
from typer.testing import CliRunner

from navfw.bench import real_benchmark
from navfw.cli import app


@pytest.mark.thorough
@pytest.mark.usefixtures("quick")
def test_reproduce_without_recordings(tmp_path: Path) -> None:
    out = tmp_path / "page"
    done = CliRunner().invoke(app, ["reproduce", "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert all(result["checks"].values())
    assert result["timings"]["paper"]["obstacles_s"] == 0.16
    assert result["real"] is None
    assert "--data DIR" in result["summary"]["Table 3, photographs"][0]
    assert {path.name for path in out.iterdir()} == {"index.html", "result.json"}
    assert list(tmp_path.iterdir()) == [out]
    assert json.loads((out / "result.json").read_text()) == result
    page = (out / "index.html").read_text()
    assert "This part is missing" in page
    assert "reproduce --data DIR" in page


def test_reproduce_leaves_other_folders_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("work")
    done = CliRunner().invoke(app, ["reproduce", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "contains 'thesis.txt', so it is not replaced; choose another --out" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        ("nowhere", "there is no such folder of recordings"),
        ("empty", "has none of the labelled recordings; expected at least one of: donkeycar"),
        ("image", "the labelled image is missing"),
        ("broken", "image_1.png"),
    ],
)
def test_a_folder_without_the_recordings_costs_one_message(
    spoil: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, out = tmp_path / "data", tmp_path / "page"
    labels = save_approach(data)
    monkeypatch.setattr(real_benchmark, "load_labels", lambda: labels)
    if spoil == "nowhere":
        data = data / "approach" / "image_1.png"
    elif spoil == "empty":
        data = data / "approach"
    elif spoil == "image":
        (data / "approach" / "image_5.png").unlink()
    else:
        for path in (data / "approach").iterdir():
            path.write_bytes(b"no image")
    done = CliRunner().invoke(app, ["reproduce", "--out", str(out), "--data", str(data)])
    assert done.exit_code == 2, done.output
    assert message in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["data"]
