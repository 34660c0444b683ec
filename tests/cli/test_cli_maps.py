"""``navfw map`` and ``navfw world show``: plans, pictures, and what the camera sees."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_calls import answer, invoke, output, refusal, sole_refusal

from navfw.numerics import Image
from navfw.topomap.map_formats import load_any_map

pytestmark = pytest.mark.usefixtures("workdir")


def read_picture(file: Path | str) -> Image:
    picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    assert picture is not None, file
    assert picture.dtype == np.uint8
    return np.asarray(picture, np.uint8)


def width_of(picture: Path) -> int:
    image = read_picture(picture)
    assert image.std() > 5.0
    return int(image.shape[1])


def test_a_plan_as_json() -> None:
    data = answer("map", "plan", "hospital", "reception", "ward-3")
    assert data["map"] == "hospital"
    assert data["places"][-1] == "ward-3"
    assert 20.0 < data["length"] < data["cost"]
    assert len(data["passages"]) == len(data["places"]) - 1
    assert all(passage["rules"] for passage in data["passages"])


def test_a_plan_as_text_and_its_plot(tmp_path: Path) -> None:
    picture = tmp_path / "way.png"
    avoid = ("--avoid", "lab-door:lab-entrance")
    text = output("map", "plan", "office", "lobby", "lab", *avoid, "--plot", picture)
    assert text.startswith("lobby to lab: ")
    assert "kitchen-lab-door" in text
    assert "IF danger IS none" in text
    assert width_of(picture) > 800


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
        (["world", "show", "offic"], ["unknown world 'offic': did you mean 'office'?"]),
        (["world", "show", "office", "--at", "1,2"], ["--at: expected X,Y,YAW, got '1,2'"]),
        (
            ["world", "show", "office", "--at", "0,0,0"],
            ["--at: the start (0, 0) must lie on the floor"],
        ),
        (
            ["world", "show", "office", "--at", "1.2,1.2,0", "--robot", "hus"],
            ["--robot: unknown robot 'hus'"],
        ),
        (["world", "show", "office", "--out", "."], [".: --out: expected a file to write"]),
    ],
)
def test_invalid_input_gives_one_message(
    tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    message = sole_refusal(*arguments)
    assert message.startswith("navfw: ")
    assert [word for word in words if word not in message] == []
    assert list(tmp_path.iterdir()) == []


def test_show_draws_the_map_over_its_world(tmp_path: Path) -> None:
    data = answer("map", "show", "office")
    assert (data["places"], data["edges"], data["over_world"]) == (50, 55, True)
    assert data["kinds"]["door"] == 9
    assert width_of(tmp_path / data["picture"]) > 800
    output("map", "convert", "office", "copy.geojson")
    copy = tmp_path / "copy.geojson"
    copy.write_text(copy.read_text().replace('"name": "office"', '"name": "../x y"'))
    assert answer("map", "show", "copy.geojson")["picture"] == "copy.png"
    assert answer("map", "show", "copy.geojson", "--out", "b.png")["over_world"] is False
    assert width_of(tmp_path / "b.png") > 800


def test_check_lists_the_problems_of_a_map_in_its_world(tmp_path: Path) -> None:
    sound = {"map": "office", "in_world": True, "ok": True, "problems": [], "assumed": []}
    assert answer("map", "check", "office") == sound
    output("map", "convert", "office", "bad.yaml")
    bad = tmp_path / "bad.yaml"
    bad.write_text(bad.read_text().replace("kitchen: {x: 9.5,", "kitchen: {x: 8.5,"))
    done = invoke("map", "check", "bad.yaml", "--world", "office", "--json")
    data = json.loads(done.stdout)
    assert (done.exit_code, data["ok"]) == (1, False)
    assert ("in-wall", "kitchen") in {(p["kind"], p["where"]) for p in data["problems"]}
    done = invoke("map", "check", "bad.yaml")
    assert (done.exit_code, "in-wall" in done.stdout) == (1, True)


def test_build_writes_a_map_that_check_accepts(tmp_path: Path) -> None:
    data = answer("map", "build", "paper-room", "--out", "built.yaml")
    assert data["places"] == len(load_any_map(tmp_path / "built.yaml").places)
    assert answer("map", "check", "built.yaml", "--world", "paper-room")["ok"]


def test_convert_there_and_back() -> None:
    answer("map", "convert", "office", "a.graphml")
    answer("map", "convert", "a.graphml", "b.geojson")
    assert answer("map", "convert", "b.geojson", "c.yaml")["edges"] == 55
    assert load_any_map("c.yaml").passages == load_any_map("a.graphml").passages


def test_what_is_assumed_of_a_map_is_said(tmp_path: Path) -> None:
    features = [
        {"properties": {"id": number}, "geometry": {"type": "Point", "coordinates": [x, 51.05]}}
        for number, x in enumerate((13.73, 13.74))
    ]
    text = json.dumps({"type": "FeatureCollection", "features": features})
    (tmp_path / "campus.geojson").write_text(text)
    for words in ("convert campus.geojson c.yaml", "check campus.geojson", "show campus.geojson"):
        done = invoke("map", *words.split(), "--json")
        (said,) = json.loads(done.stdout)["assumed"]
        assert said["taken"] == "metres east and north of longitude 13.73, latitude 51.05"
        assert done.stderr.startswith("assumed: coordinates: metres east and north of")
    assert answer("map", "diff", "campus.geojson", "c.yaml")["assumed"] == [said]
    assert answer("map", "convert", "c.yaml", "d.geojson")["assumed"] == []


@pytest.mark.parametrize("name", ["campus.dot", "campus.gml"])
def test_other_formats_of_graphs_are_refused_with_those_that_are_read(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_text("graph {a -- b}")
    said = refusal("map", "convert", name, "c.yaml")
    assert f"{name}: expected a map file (.yaml, .yml, .graphml, .geojson, .json)" in said


def test_the_floor_plan_is_drawn(tmp_path: Path) -> None:
    summary = answer("world", "show", "office", "--out", tmp_path / "plan.png")
    assert summary["size_m"] == [16.0, 10.0]
    assert {"lobby", "lab"} <= set(summary["rooms"])
    assert "lobby-to-lab" in summary["missions"]
    height, width, _ = read_picture(summary["picture"]).shape
    assert abs(width / height - 1.6) < 0.1


def test_the_camera_sees_the_wall_ahead_of_it() -> None:
    said = output("world", "show", "office", "--at", "1.2,1.2,0.6")
    assert "picture office-camera.png, from 1.2,1.2,0.6 by the camera of default" in said
    ahead = read_picture("office-camera.png")
    assert ahead.shape == (120, 160)
    output("world", "show", "office", "--at", "1.2,1.2,2.2", "--out", "back.png")
    assert np.abs(ahead.astype(float) - read_picture("back.png")).mean() > 10.0
