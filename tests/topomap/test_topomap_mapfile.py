from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.config import parse_yaml
from navfw.errors import ConfigError, InputError, MapError
from navfw.topomap import Landmark, Passage, Place, TopoMap, load_map, map_text, read_map

shares = st.floats(0.0, 1.0)
texts = st.one_of(
    st.sampled_from(
        ["yes", "null", "1e5", "0x1f", "2001-01-01", "a: b", "- x", "#", "~", "é", "="]
    ),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), min_size=1, max_size=8),
)
GOOD = """\
name: flat
places:
  hall: {x: 0, y: 0}
  door: {x: 3, y: 0, kind: door}
  stairs: {x: 3, y: 4, kind: danger}
edges:
  - {from: hall, to: door, width: 0.9}
  - {from: door, to: stairs, length: 5, uncertainty: 0.5, doorness: 0.2}
landmarks:
  sign: {kind: aruco, id: 7, x: 0.1, y: 2, z: 0.6, yaw: 1.57, size: 0.2}
  notice: {kind: poster, id: 7, x: 3, y: 1, yaw: -3.14}
"""


SECOND_ID = ["landmarks.notice.id", "second aruco-7", "'sign' has that id", "first is in line 10"]


def write(folder: Path, text: str) -> Path:
    path = folder / "flat.yaml"
    path.write_text(text)
    return path


def test_values_left_out_get_defaults(tmp_path: Path) -> None:
    topo_map = load_map(write(tmp_path, GOOD))
    assert topo_map.name == "flat"
    assert topo_map.place("hall").kind == "room"
    first, second = topo_map.passages
    assert (first.length, first.width, first.doorness, first.danger) == (3.0, 0.9, 1.0, 0.0)
    assert (second.length, second.width, second.doorness, second.danger) == (5, math.inf, 0.2, 1.0)
    assert second.uncertainty == 0.5
    sign, notice = topo_map.landmarks.values()
    assert sign == Landmark("sign", "aruco", 7, 0.1, 2.0, 1.57, 0.6, 0.2)
    assert (notice.identity, notice.z, notice.size) == ("poster-7", 0.5, 0.25)
    assert topo_map.landmarks_by_identity["aruco-7"] is sign


@pytest.mark.parametrize(
    ("old", "new", "error", "line", "words"),
    [
        ("to: door,", "to: dor,", MapError, 7, ["edges[0].to", "'dor'", "did you mean 'door'"]),
        ("length: 5", "length: 0", MapError, 8, ["edges[1].length", "more than 0 m", "leave it"]),
        ("length: 5", "length: -1", MapError, 8, ["edges[1].length", "got -1"]),
        ("length: 5", "length: 3.5", MapError, 8, ["shorter than the straight line", "4.00 m"]),
        ("width: 0.9", "width: 0", MapError, 7, ["edges[0].width", "more than 0 m"]),
        ("to: stairs", "to: hall", MapError, 8, ["same passage as", "the first is in line 7"]),
        ("to: stairs", "to: door", MapError, 8, ["itself"]),
        ("kind: danger", "kind: dnger", ConfigError, 5, ["places.stairs.kind", "'danger'"]),
        ("length: 5", "lenght: 5", ConfigError, 8, ["lenght", "did you mean 'length'"]),
        ("from: hall", "form: hall", ConfigError, 7, ["form", "did you mean 'from'"]),
        ("x: 0, ", "", ConfigError, 3, ["places.hall.x", "missing"]),
        ("x: 0, ", "x: wide, ", ConfigError, 3, ["places.hall.x", "number", "wide"]),
        ("x: 0, ", "x: .nan, ", ConfigError, 3, ["places.hall.x"]),
        ("  stairs:", "  hall:", ConfigError, 5, ["duplicate key"]),
        ("kind: poster", "kind: aruco", MapError, 11, SECOND_ID),
        ("kind: poster", "kind: postr", ConfigError, 11, ["landmarks.notice.kind", "'poster'"]),
        ("yaw: -3.14", "yw: -3.14", ConfigError, 11, ["yw", "did you mean 'yaw'"]),
        ("  notice:", "  sign:", ConfigError, 11, ["duplicate key"]),
        ("size: 0.2", "size: 0", ConfigError, 10, ["landmarks.sign.size", "0"]),
        ("id: 7, x: 3", "id: -1, x: 3", ConfigError, 11, ["landmarks.notice.id", "-1"]),
        ("uncertainty: 0.5", "danger: 2", ConfigError, 8, ["edges[1].danger", "2"]),
    ],
)
def test_errors_name_file_line_and_key(
    tmp_path: Path, old: str, new: str, error: type[InputError], line: int, words: list[str]
) -> None:
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(error) as caught:
        load_map(path)
    for word in (f"flat.yaml:{line}: ", *words):
        assert word in str(caught.value)


def test_one_message_lists_all_errors(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD.replace("to: door", "to: dor").replace("length: 5", "length: 0"))
    with pytest.raises(MapError) as caught:
        load_map(path)
    lines = str(caught.value).splitlines()
    assert "2 errors" in lines[0]
    assert "flat.yaml:7: edges[0].to" in lines[1]
    assert "flat.yaml:8: edges[1].length" in lines[2]


def test_unconnected_parts_are_no_error_and_a_map_without_places_is(tmp_path: Path) -> None:
    apart = GOOD.replace("  - {from: hall, to: door, width: 0.9}\n", "")
    assert len(load_map(write(tmp_path, apart)).parts) == 2
    with pytest.raises(MapError, match="places: expected at least one place"):
        load_map(write(tmp_path, "name: none\nplaces: {}\n"))


@given(texts, st.floats(1e-6, 1e6), shares, st.floats(-6.2, 6.2))
def test_names_and_numbers_survive_the_file(
    name: str, length: float, share: float, yaw: float
) -> None:
    places = [Place(name, 0.0, 0.0), Place(name + "2", 0.0, 1e-7, "danger")]
    passage = Passage(name, name + "2", length, danger=share)
    mark = Landmark(name, "poster", 3, length, -length, yaw)
    first = TopoMap(name, places, [passage], landmarks=[mark])
    again = read_map(parse_yaml(map_text(first), "m.yaml"))
    assert again.name == name
    assert list(again.places.values()) == places
    assert again.passages == (passage,)
    assert list(again.landmarks.values()) == [mark]
