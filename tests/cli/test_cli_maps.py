"""``navfw map`` and ``navfw world show``: plans, pictures, and what the camera sees."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from cli_calls import invoke
from typer.testing import Result

from navfw.topomap import load_any_map


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def ran(*arguments: str, code: int = 0) -> str:
    done = invoke(*arguments)
    assert done.exit_code == code, done.output
    return done.stderr if code == 2 else done.stdout


def json_of(*arguments: str, code: int = 0) -> dict[str, Any]:
    data = json.loads(ran(*arguments, "--json", code=code))
    assert isinstance(data, dict)
    return data


def size(picture: Path) -> tuple[int, int]:
    image = cv2.imread(str(picture))
    assert image is not None
    assert image.std() > 5.0
    return image.shape[1], image.shape[0]


def test_a_plan_as_json() -> None:
    data = json_of("map", "plan", "hospital", "reception", "ward-3")
    assert data["map"] == "hospital"
    assert data["places"][-1] == "ward-3"
    assert 20.0 < data["length"] < data["cost"]
    assert len(data["passages"]) == len(data["places"]) - 1
    assert all(passage["rules"] for passage in data["passages"])


def test_a_plan_as_text_and_its_plot(tmp_path: Path) -> None:
    picture = tmp_path / "way.png"
    avoid = ("--avoid", "lab-door:lab-entrance")
    text = ran("map", "plan", "office", "lobby", "lab", *avoid, "--plot", str(picture))
    assert text.startswith("lobby to lab: ")
    assert "kitchen-lab-door" in text
    assert "IF danger IS none" in text
    assert size(picture)[0] > 800


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["map", "plan", "office", "lobby", "lba"], ["place 'lba'", "did you mean 'lab'"]),
        (["map", "plan", "ofice", "lobby", "lab"], ["map 'ofice'", "did you mean 'office'"]),
        (["map", "plan", "office", "lobby", "lab", "--avoid", "lab"], ["PLACE:PLACE"]),
        (["map", "plan", "office", "lobby", "lab", "--avoid", "lab:lobby"], ["no passage between"]),
        (
            ["map", "plan", "office", "9,99", "lab"],
            ["the start (9.00, 99.00) is", "away from everything"],
        ),
        (["map", "show", "office", "--world", "ofice"], ["world 'ofice'"]),
        (["map", "convert", "office", "office.txt"], [".graphml", "office.txt"]),
        (["map", "convert", "none.geojson", "a.yaml"], ["none.geojson", "no such file"]),
        (["map", "build", "ofice", "--out", "a.yaml"], ["world 'ofice'"]),
    ],
)
def test_invalid_input_gives_one_message(
    tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    message = ran(*arguments, code=2)
    assert message.startswith("navfw: ")
    assert [word for word in words if word not in message] == []
    assert list(tmp_path.iterdir()) == []


def test_show_draws_the_map_over_its_world(tmp_path: Path) -> None:
    data = json_of("map", "show", "office")
    assert (data["places"], data["edges"], data["over_world"]) == (50, 55, True)
    assert data["kinds"]["door"] == 9
    assert size(tmp_path / data["picture"])[0] > 800
    ran("map", "convert", "office", "copy.geojson")
    text = (tmp_path / "copy.geojson").read_text().replace('"name": "office"', '"name": "../x y"')
    (tmp_path / "copy.geojson").write_text(text)
    assert json_of("map", "show", "copy.geojson")["picture"] == "copy.png"
    assert json_of("map", "show", "copy.geojson", "--out", "b.png")["over_world"] is False
    assert size(tmp_path / "b.png")[0] > 800


def test_check_lists_the_problems_of_a_map_in_its_world(tmp_path: Path) -> None:
    sound = {"map": "office", "in_world": True, "ok": True, "problems": []}
    assert json_of("map", "check", "office") == sound
    ran("map", "convert", "office", "bad.yaml")
    text = (tmp_path / "bad.yaml").read_text()
    (tmp_path / "bad.yaml").write_text(text.replace("kitchen: {x: 9.5,", "kitchen: {x: 8.5,"))
    data = json_of("map", "check", "bad.yaml", "--world", "office", code=1)
    assert not data["ok"]
    assert ("in-wall", "kitchen") in {(p["kind"], p["where"]) for p in data["problems"]}
    assert "in-wall" in ran("map", "check", "bad.yaml", code=1)


def test_build_writes_a_map_that_check_accepts(tmp_path: Path) -> None:
    data = json_of("map", "build", "paper-room", "--out", "built.yaml")
    assert data["places"] == len(load_any_map(tmp_path / "built.yaml").places)
    assert json_of("map", "check", "built.yaml", "--world", "paper-room")["ok"]


def test_convert_there_and_back() -> None:
    json_of("map", "convert", "office", "a.graphml")
    json_of("map", "convert", "a.graphml", "b.geojson")
    assert json_of("map", "convert", "b.geojson", "c.yaml")["edges"] == 55
    assert load_any_map("c.yaml").passages == load_any_map("a.graphml").passages


def test_bench_planning() -> None:
    data = json_of("bench", "planning", "--places", "200", "--repeats", "3")
    assert {"costs_ms", "first_plan_ms", "replan_ms", "networkx_ms"} <= set(data)
    assert data["replan_over_networkx"] > 0.0
    assert "networkx.astar_path" in ran("bench", "planning", "--places", "200", "--repeats", "3")


# --- worlds --------------------------------------------------------------------------------------


def show(*arguments: str) -> Result:
    return invoke("world", "show", *arguments)


def read_picture(file: str) -> npt.NDArray[Any]:
    picture = cv2.imread(file, cv2.IMREAD_UNCHANGED)
    assert picture is not None, file
    return np.asarray(picture)


def test_the_floor_plan_is_drawn(tmp_path: Path) -> None:
    done = show("office", "--out", str(tmp_path / "plan.png"), "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert summary["size_m"] == [16.0, 10.0]
    assert {"lobby", "lab"} <= set(summary["rooms"])
    assert "lobby-to-lab" in summary["missions"]
    height, width, _ = read_picture(summary["picture"]).shape
    assert abs(width / height - 1.6) < 0.1


def test_the_camera_sees_the_wall_ahead_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = show("office", "--at", "1.2,1.2,0.6")
    assert done.exit_code == 0, done.output
    assert "picture office-camera.png, from 1.2,1.2,0.6 by the camera of default" in done.stdout
    ahead = read_picture("office-camera.png")
    assert (ahead.shape, ahead.dtype.name) == ((120, 160), "uint8")
    assert show("office", "--at", "1.2,1.2,2.2", "--out", "back.png").exit_code == 0
    assert np.abs(ahead.astype(float) - read_picture("back.png")).mean() > 10.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("offic",), "unknown world 'offic': did you mean 'office'?"),
        (("office", "--at", "1,2"), "--at: expected X,Y,YAW, got '1,2'"),
        (("office", "--at", "0,0,0"), "--at: the start (0, 0) must lie on the floor"),
        (("office", "--at", "1.2,1.2,0", "--robot", "hus"), "--robot: unknown robot 'hus'"),
        (("office", "--out", "."), ".: --out: expected a file to write"),
    ],
)
def test_what_is_wrong_is_said(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    done = show(*arguments)
    assert (done.exit_code, done.stdout) == (2, "")
    assert message in done.stderr
