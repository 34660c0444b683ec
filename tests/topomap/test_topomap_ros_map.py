"""Floor plans in files of map_server: what its modes mean, and what is refused."""

import math
from dataclasses import astuple
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from navfw.errors import ConfigError, InputError, MapError
from navfw.signals import Pose
from navfw.sim import load_world
from navfw.topomap import Place, TopoMap, load_map
from navfw.topomap.map_formats import load_any_map, save_map
from navfw.topomap.occupancy_map import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    OccupancyMap,
    load_ros_map,
    save_ros_map,
)
from navfw.worldgen.plan_exchange import exported_plan

ROOT = Path(__file__).parents[2]
GREYS = np.array([[0, 64, 100], [205, 206, 255]], dtype=np.uint8)


def write(folder: Path, image: str = "plan.pgm", pixels: Any = GREYS, **keys: Any) -> Path:
    """A yaml file with these keys, and its image."""
    data: dict[str, Any] = {"image": image, "resolution": 0.05, "origin": [0, 0, 0], **keys}
    target = folder / image
    target.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(target), pixels)
    file = folder / "plan.yaml"
    file.write_text("".join(f"{key}: {value}\n" for key, value in data.items()))
    return file


def states(file: Path) -> list[list[int]]:
    """Cells from the top row of the image down."""
    cells: list[list[int]] = load_ros_map(file).cells[::-1].tolist()
    return cells


@pytest.mark.parametrize("image", ["plan.pgm", "plan.png", "plan.bmp"])
@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        # occupancy 1, 0.75, 0.61 / 0.196, 0.19, 0
        ({}, [[100, 100, -1], [-1, 0, 0]]),
        ({"free_thresh": 0.25}, [[100, 100, -1], [-1, 0, 0]]),  # 205 is unknown all the same
        ({"free_thresh": 0.1, "occupied_thresh": 0.8}, [[100, -1, -1], [-1, -1, 0]]),
        ({"mode": "scale", "free_thresh": 0.25}, [[100, 100, -1], [0, 0, 0]]),
        ({"mode": "raw"}, [[0, -1, 100], [-1, -1, -1]]),
        ({"mode": "raw", "negate": 1}, [[0, -1, 100], [-1, -1, -1]]),
        # negated: occupancy 0, 0.25, 0.39 / 0.80, 0.81, 1
        ({"negate": 1, "free_thresh": 0.3}, [[0, 0, -1], [100, 100, 100]]),
    ],
)
def test_the_modes_of_map_server(
    tmp_path: Path, image: str, keys: dict[str, Any], expected: list[list[int]]
) -> None:
    assert states(write(tmp_path, image, **keys)) == expected


def test_negate_as_a_number_or_truth_value_and_keys_of_others(tmp_path: Path) -> None:
    for value in ("1", "true"):
        file = write(tmp_path, negate=value, map_type="occupancy", map_id="first")
        assert states(file)[0][0] == FREE


def test_colours_16_bits_and_transparent_pixels(tmp_path: Path) -> None:
    red = np.zeros((1, 1, 3), np.uint8)
    red[..., 2] = 255
    assert states(write(tmp_path, "plan.png", red)) == [[OCCUPIED]]  # a third of full brightness
    bright = np.array([[0, 65535]], np.uint16)
    assert states(write(tmp_path, "plan.png", bright)) == [[OCCUPIED, FREE]]
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 1, 3] = 200
    assert states(write(tmp_path, "plan.png", pixels, mode="scale")) == [[FREE, UNKNOWN]]
    assert states(write(tmp_path, "plan.png", pixels)) == [[FREE, UNKNOWN]]
    pixels[0, 1] = 0  # as GIMP erases black
    assert states(write(tmp_path, "plan.png", pixels)) == [[FREE, UNKNOWN]]


def pgm(kind: str, largest: int, *values: int) -> bytes:
    """An image of 2 x 2 pixels; P2 without a line feed at its end, as some tools write it."""
    head = f"{kind}\n# CREATOR: map_saver 0.050 m/pix\n2 2\n{largest}\n".encode()
    if kind == "P2":
        return head + " ".join(map(str, values)).encode()
    return head + np.array(values, ">u2" if largest > 255 else "u1").tobytes()


@pytest.mark.parametrize("kind", ["P2", "P5"])
@pytest.mark.parametrize("largest", [1, 5, 100, 255, 1023, 65535])
def test_the_values_of_a_pgm_are_shares_of_its_largest(
    tmp_path: Path, kind: str, largest: int
) -> None:
    file = write(tmp_path)
    grey = round(0.6 * largest)  # 1 where there are only 0 and 1
    (tmp_path / "plan.pgm").write_bytes(pgm(kind, largest, 0, largest, grey, largest))
    middle = FREE if largest == 1 else UNKNOWN
    assert states(file) == [[OCCUPIED, FREE], [middle, FREE]]


def test_pgms_of_windows_and_turned_photographs(tmp_path: Path) -> None:
    file = write(tmp_path)
    head = b"P5\r\n2 2\r\n255\r\n"
    (tmp_path / "plan.pgm").write_bytes(head + bytes((0, 254, 205, 254)))
    assert states(file) == [[OCCUPIED, FREE], [UNKNOWN, FREE]]
    drawn = Image.fromarray(np.kron(np.array([[0, 254]], np.uint8), np.ones((16, 16), np.uint8)))
    exif = Image.Exif()
    exif[0x0112] = 6  # as a telephone held upright writes it
    drawn.save(tmp_path / "plan.jpg", exif=exif)
    file.write_text(file.read_text().replace("plan.pgm", "plan.jpg"))
    assert np.array(states(file)).shape == (32, 16)


def test_jpegs_have_a_band_of_unknown_grey(tmp_path: Path) -> None:
    pixels = np.kron(np.array([[0, 205, 254]], np.uint8), np.ones((16, 16), np.uint8))
    read = np.array(states(write(tmp_path, "plan.jpg", pixels)))
    assert (read[:, 20:28] == UNKNOWN).all()
    assert (read[:, 36:] == FREE).all()
    assert (read[:, :12] == OCCUPIED).all()


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"mode": "ternary"}, "mode"),
        ({"resolution": 0}, "resolution"),
        ({"resolution": "nan"}, "resolution"),
        ({"resolution": 20}, "pixels a metre[?] Write 0.05"),
        ({"origin": "[0, 0]"}, "origin"),
        ({"origin": "[0, 0, 90]"}, "got 90: degrees[?] Write 1.5708"),
        ({"origin": "[0, 0, -45.0]"}, "degrees[?] Write -0.785398"),
        ({"origin": "[0, 0, -nan]"}, r"origin\[2\]: expected radians .0.0 if unknown., got nan"),
        ({"origin": "[0, 0, north]"}, "'north'"),
        ({"free_thresh": 19.6}, "per cent[?] Write 0.196"),
        ({"occupied_thresh": 165}, "occupied_thresh: expected 0 to 1, got 165$"),
        ({"mode": ""}, "mode: expected one of .*, got nothing"),
        ({"resolution": "null"}, "resolution"),
        ({"origin": "[0, 0, .inf]"}, "origin"),
        ({"origin": "[1e9, 0, 0]"}, "origin"),
        ({"negate": 2}, "negate"),
        ({"free_thresh": -0.1}, ">= 0 and <= 1"),
        ({"free_thresh": 0.7}, "must be below occupied_thresh"),
    ],
)
def test_what_the_yaml_file_may_not_say(tmp_path: Path, keys: dict[str, Any], message: str) -> None:
    file = write(tmp_path, **keys)
    with pytest.raises(ConfigError, match=message) as caught:
        load_ros_map(file)
    assert str(file) in str(caught.value)


def test_values_as_other_tools_write_them(tmp_path: Path) -> None:
    file = write(
        tmp_path, resolution='"0.05"', mode="Trinary", negate="no", occupied_thresh="'0.65'"
    )
    assert load_ros_map(file).resolution == 0.05
    assert states(file)[0][0] == OCCUPIED


@pytest.mark.parametrize(
    "name", ["/home/robot/maps/plan.pgm", "~/plan.pgm", "maps/plan.pgm", "C:\\maps\\Plan.PGM"]
)
def test_paths_of_other_computers_mean_the_image_beside(tmp_path: Path, name: str) -> None:
    file = write(tmp_path)
    file.write_text(file.read_text().replace("plan.pgm", name))
    (assumption,) = load_ros_map(file).assumed
    assert assumption.taken == "plan.pgm beside the yaml file"
    (tmp_path / "maps").mkdir()
    (tmp_path / "plan.pgm").rename(tmp_path / "maps" / "plan.pgm")
    if name == "maps/plan.pgm":
        assert load_ros_map(file).assumed == ()
    else:
        with pytest.raises(ConfigError, match="copy the image beside it"):
            load_ros_map(file)


@pytest.mark.parametrize("name", ["/etc/map.pgm", "../../map.pgm", "../a/../../../map.pgm"])
def test_images_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    home = tmp_path / "a" / "b"
    file = write(home)
    file.write_text(file.read_text().replace("plan.pgm", name))
    with pytest.raises(ConfigError, match="copy the image beside it and write image: map"):
        load_ros_map(file)


def test_images_beside_of_other_kinds_or_missing(tmp_path: Path) -> None:
    assert load_ros_map(write(tmp_path / "yaml", "../images/plan.png")).free.any()
    with pytest.raises(ConfigError, match="convert it"):
        load_ros_map(write(tmp_path, "plan.webp"))
    file = write(tmp_path)
    (tmp_path / "plan.pgm").unlink()
    (tmp_path / "Plan.png").touch()
    with pytest.raises(ConfigError, match=r"there is no 'plan.pgm' .*did you mean 'Plan.png'"):
        load_ros_map(file)
    floats = write(tmp_path, "plan.tif", GREYS.astype(np.float32) / 255.0)
    with pytest.raises(ConfigError, match="neither 8 nor 16 bits"):
        load_ros_map(floats)
    file = write(tmp_path)
    (tmp_path / "plan.pgm").write_bytes(b"P5\n9 9\n255\nshort")
    with pytest.raises(ConfigError, match="image"):
        load_ros_map(file)


def test_too_many_cells(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="4000 x 4001 pixels"):
        load_ros_map(write(tmp_path, "wide.png", np.zeros((4001, 4000), np.uint8)))
    with pytest.raises(MapError, match="got 0 x 3"):
        OccupancyMap(np.zeros((3, 0), np.int8), 0.05, Pose(0, 0, 0))


plans = st.builds(
    OccupancyMap,
    st.lists(
        st.lists(st.sampled_from([FREE, OCCUPIED, UNKNOWN]), min_size=3, max_size=3),
        min_size=1,
        max_size=5,
    ).map(lambda rows: np.array(rows, np.int8)),
    st.floats(0.01, 1.0),
    st.builds(Pose, st.floats(-90, 90), st.floats(-90, 90), st.floats(-3, 3)),
)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(plans, st.sampled_from([".pgm", ".png", ".bmp"]))
def test_what_is_written_is_read_again(tmp_path: Path, plan: OccupancyMap, suffix: str) -> None:
    image = save_ros_map(plan, tmp_path / "p.yaml", suffix)
    assert np.isin(np.array(cv2.imread(str(image), -1)), [0, 205, 254]).all()
    again = load_ros_map(tmp_path / "p.yaml")
    assert np.array_equal(again.cells, plan.cells)
    assert again.resolution == plan.resolution
    assert astuple(again.origin) == pytest.approx(astuple(plan.origin), abs=1e-6)


@settings(max_examples=40)
@given(plans)
def test_cells_are_found_at_their_centres(plan: OccupancyMap) -> None:
    rows, columns = np.indices(plan.cells.shape).reshape(2, -1)
    centres = plan.centres(rows, columns)
    assert np.array_equal(plan.state(centres), plan.cells.ravel())
    assert plan.state(np.array([[500.0, 500.0]])).tolist() == [UNKNOWN]


def test_the_origin_turns_the_grid() -> None:
    plan = OccupancyMap(np.array([[FREE, OCCUPIED]], np.int8), 1.0, Pose(2, 3, math.pi / 2))
    assert plan.centres(*np.nonzero(plan.occupied)) == pytest.approx(np.array([[1.5, 4.5]]))
    with pytest.raises(ValueError, match="read-only"):
        plan.cells[0, 0] = OCCUPIED


@pytest.mark.parametrize("suffix", ["yaml", "graphml", "geojson"])
def test_a_map_is_saved_with_its_floor_plan(tmp_path: Path, suffix: str) -> None:
    plan = OccupancyMap(np.array([[FREE, OCCUPIED]], np.int8), 0.1, Pose(1, 2, 0))
    path = tmp_path / f"hall.{suffix}"
    save_map(TopoMap("hall", [Place("here", 0, 0)], [], floor_plan=plan), path)
    again = load_any_map(path).floor_plan
    assert again is not None
    assert np.array_equal(again.cells, plan.cells)
    assert again.origin == plan.origin
    (tmp_path / "plans" / "hall.yaml").unlink()
    with pytest.raises(InputError, match=r"hall\.yaml: there is no such file"):
        load_any_map(path)


def test_shipped_floor_plans_are_those_of_their_worlds() -> None:
    expected = exported_plan(load_world(ROOT / "worlds" / "office" / "world.yaml"), walls_only=True)
    for name in ("office", "office-stairs"):
        plan = load_map(ROOT / "maps" / f"{name}.yaml").floor_plan
        assert plan is not None
        assert np.array_equal(plan.cells, expected.cells)
        assert plan.origin == expected.origin
