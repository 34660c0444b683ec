"""Real frames: their labels, sentences judged by them, and the measures of recordings."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from cli_calls import answer, invoke, refusal
from navfw_benchmarks.bench import real_benchmark
from navfw_benchmarks.bench.real_benchmark import RECORDINGS, bench_real
from navfw_benchmarks.bench.real_labels import (
    judge,
    load_labels,
    nearness_errors,
    posed_images,
    recorded_gyro,
    yaw_rates,
    yaw_summary,
)
from perceive_images import HEIGHT, WIDTH, label, save, save_approach, texture, wall_at

from navfw.errors import ConfigError
from navfw.perceive.image_sources import open_source
from navfw.perceive.pair_result import PairResult
from navfw.perceive.perceiver import Perceiver
from navfw.perceive.perceiver_options import PerceiverOptions, WorkingSize
from navfw.plugins import default_registry

ROOT = Path(__file__).parents[2]
QUADRANTS = {"upper_left", "upper_right", "lower_left", "lower_right"}
FRONTS = {"wall", "corner", "corridor", "door", "object", "open", "unknown"}
LABELS = load_labels()
MOVING = [row for row in LABELS if not row.single]
STEP = 0.05
"""Distance [m] that the camera travels between two images."""

# --- labels (benchmarks/real-frames.md): form, amount, splits -------------------------------------


def test_every_label_is_one_of_the_rule() -> None:
    for row in LABELS:
        nearest = row.nearest
        assert nearest in ({"none"}, {"unknown"}) or (nearest and nearest <= QUADRANTS), row
        assert row.nearest_also <= QUADRANTS - nearest, row
        assert row.front in FRONTS, row
        assert row.front_also <= FRONTS - {"unknown", row.front}, row
        assert row.floor_in_front in {"yes", "no", "unknown"}, row
        assert row.split in {"tuning", "test"}, row
        assert row.single == (row.folder == "corridor_udes"), row
        assert re.fullmatch(r"[\w.]+\.(jpg|png)", row.file), row
        assert re.fullmatch(r"\w+(/\w+)*", row.folder), row


def test_over_450_frames_are_labelled_once_and_their_cameras_are_known() -> None:
    assert len({(row.folder, row.file) for row in LABELS}) == len(LABELS) > 450
    assert {row.folder for row in LABELS} == set(RECORDINGS)


def test_a_part_belongs_to_one_split_and_one_folder() -> None:
    places = {(row.part, row.split, row.folder) for row in LABELS}
    assert len(places) == len({row.part for row in LABELS})
    page = (ROOT / "benchmarks/real-frames.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)` \| `([\w/]+)` \| .* \| (\w+) \|$", page, re.MULTILINE)
    assert {(part, split, folder) for part, folder, split in listed} == places


# --- sentences judged by labels ------------------------------------------------------------------

OTHERWISE = {"also": "upper_right", "front_also": "wall"}
NOTHING = "Layer1: no object in sight; Front is unknown"
SEEN = "Layer1: nearest object is on upper left in near distance; Front is a {}"


@pytest.mark.parametrize(
    ("sentence", "nearest", "truth", "verdict"),
    [
        (SEEN.format("door or corridor") + "; Floor in front", {"P2": "near"}, {}, "right"),
        (SEEN.format("wall") + "; Floor in front", {"P2": "near"}, {}, "partly"),
        (SEEN.format("wall"), {"P1": "near"}, {}, "wrong"),
        (SEEN.format("left slope wall or unknown"), {"P2": "near"}, {"front": "wall"}, "right"),
        (SEEN.format("wall"), {"P1": "near"}, OTHERWISE, "right"),
        (NOTHING, {}, {}, "wrong"),
        (NOTHING, {}, {"nearest": "none"}, "right"),
        (NOTHING, {}, {"nearest": "unknown"}, "silent"),
        ("Layer1: nearest object is unknown; Front is unknown", {}, {}, "silent"),
        ("Front is unknown; Floor in front", {}, {"floor": "no"}, "wrong"),
        ("Front is unknown; Floor in front", {}, {"floor": "unknown"}, "silent"),
        ("", {"P2": "far"}, {"nearest": "none", "also": "upper_left"}, "right"),
        ("", {"P2": "near"}, {"nearest": "none", "also": "upper_left"}, "wrong"),
        ("Front is a door", {}, {"front": "open"}, "wrong"),
        ("Front is a door", {}, {"front": "unknown"}, "silent"),
    ],
)
def test_a_sentence_is_judged_by_the_rule(
    sentence: str, nearest: dict[str, str], truth: dict[str, str], verdict: str
) -> None:
    assert judge(sentence, nearest, label(**truth)).verdict == verdict


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


@pytest.mark.slow
def test_the_benchmark_counts_verdicts_and_headings(approach: Path) -> None:
    result = bench_real(approach, "tuning", ["dis"], default_registry())
    assert result["frames"] == 2
    row = result["flows"]["dis"]["parts"]["approach, a"]
    assert row["verdicts"]["right"] == 2, row
    assert row["statements"] == {"front right": 2, "nearest right": 2}
    assert row["pairs"] == 4
    assert rows_of(result)[-1][:6] == ["dis", "all", "2", "0", "0", "0"]
    assert bench_real(approach, "test", ["dis"], default_registry())["frames"] == 0


@pytest.mark.slow
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
    words = ("bench", "real", "--data", approach, "--split")
    options = (*words, "tuning", "--flow", "dis")
    assert answer(*options)["flows"]["dis"]["total"]["verdicts"]["right"] == 2
    assert "approach, a" in invoke(*options).stdout
    assert "--split" in refusal(*words, "x")


# --- nearness by depth, yaw rate by a gyro, on drawn images --------------------------------------


@pytest.fixture(scope="module")
def approached(tmp_path_factory: pytest.TempPathFactory) -> tuple[PairResult, WorkingSize]:
    """The last pair of an approach to a wall, now 1.8 m away."""
    picture = texture()
    folder = tmp_path_factory.mktemp("wall")
    save(folder, [wall_at(1.95 - STEP * k, picture) for k in range(4)])
    options = PerceiverOptions(stride=1, pitch=0.0)
    perceiver = Perceiver(options, open_source([folder], 10.0), default_registry())
    results = [result for _, result in perceiver.results()]
    assert perceiver.size is not None
    return results[-1], perceiver.size


def test_nearness_is_judged_by_depth(approached: tuple[PairResult, WorkingSize]) -> None:
    result, size = approached
    depth = np.full((HEIGHT, WIDTH), 1.8)
    found = nearness_errors(result, size, depth, STEP)
    assert found.number == result.percept.nearness.size
    assert len(found.by_way) > 0.3 * found.number
    assert float(np.median(found.by_way)) < 0.06
    assert float(np.median(found.up_to_scale)) < 0.06
    # a camera that went twice as far: nearness is half of the true one, up to scale it is right
    far = nearness_errors(result, size, depth, 0.5 * STEP)
    assert float(np.median(far.by_way)) == pytest.approx(1.0, abs=0.12)
    assert far.up_to_scale == pytest.approx(found.up_to_scale)


def test_cells_without_depth_or_without_result_are_not_judged(
    approached: tuple[PairResult, WorkingSize],
) -> None:
    result, size = approached
    depth = np.full((HEIGHT, WIDTH), 1.8)
    depth[:, : WIDTH // 2] = 0.0
    half = nearness_errors(result, size, depth, STEP)
    assert half.number == result.percept.nearness.size // 2
    silent = nearness_errors(replace(result, known=False), size, depth, STEP)
    assert (silent.number, len(silent.by_way)) == (half.number, 0)


def test_depth_images_have_a_unit(tmp_path: Path) -> None:
    for folder in ("images", "depth"):
        (tmp_path / "hololens_office" / folder).mkdir(parents=True)
        for k in (1, 2):
            file = tmp_path / "hololens_office" / folder / f"{k}.png"
            assert cv2.imwrite(str(file), np.array([[0, 1500]], np.uint16))
    np.savetxt(tmp_path / "hololens_office" / "poses.txt", np.stack([np.eye(4).ravel()] * 2))
    image = posed_images(tmp_path, "hololens_office/images")["1.png"]
    assert image.depth().tolist() == [[0.0, 1.5]]
    assert replace(image, unit=5000.0).depth()[0, 1] == 0.3
    assert posed_images(tmp_path, "donkeycar/images") == {}


def readings(folder: Path, rows: int) -> list[Path]:
    """Names of images, and a file with a time and a constant turn of 30 deg/s for each of them."""
    lines = [f"{k},{100.0 + 0.1 * k:.1f},30.0" for k in range(rows)]
    (folder / "readings.csv").write_text("\n".join(["frame,time_s,gyro_z_deg_s", *lines]))
    return [folder / f"{k}.png" for k in range(rows)]


def test_yaw_rates_are_compared_at_the_time_of_the_pair(
    tmp_path: Path, approached: tuple[PairResult, WorkingSize]
) -> None:
    images = readings(tmp_path, 8)
    gyro = recorded_gyro(tmp_path, images)
    assert gyro is not None
    times, record = gyro
    assert times.of(images[2:4]) == [100.2, 100.3]
    lying = recorded_gyro(tmp_path, images, "y")
    assert lying is not None
    assert lying[1].rates[:, 0] == pytest.approx(record.rates[:, 2])
    first = approached[0]
    turn = np.array([0.0, 0.0, 0.04])
    turned = replace(first, time=0.2, motion=replace(first.motion, dt=0.1), rotation_vector=turn)
    beyond = replace(turned, time=9.0)
    rates = yaw_rates([turned, beyond], 100.2, record)
    assert rates == pytest.approx(np.array([[0.4, np.radians(30.0)]]))


def test_a_recording_without_or_with_too_few_readings(tmp_path: Path) -> None:
    assert recorded_gyro(tmp_path, []) is None
    images = readings(tmp_path, 4)
    with pytest.raises(ConfigError, match="a row for each of 3 images, found 4"):
        recorded_gyro(tmp_path, images[:3])


def test_correlation_and_slope_of_the_yaw_rate() -> None:
    gyro = np.linspace(-1.0, 1.0, 20)
    camera = 1.1 * gyro + 0.2 * np.where(np.arange(20) % 2, 1.0, -1.0)
    found = yaw_summary(np.stack([camera, gyro], axis=1))
    assert found["yaw_pairs"] == 20
    assert found["yaw_slope"] == pytest.approx(1.1, abs=0.05)
    assert 0.9 < found["yaw_correlation"] < 0.99
    assert yaw_summary(np.empty((0, 2)))["yaw_correlation"] is None
    standing = yaw_summary(np.zeros((20, 2)))
    assert (standing["yaw_pairs"], standing["yaw_slope"]) == (20, None)
