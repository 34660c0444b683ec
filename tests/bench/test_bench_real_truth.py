"""Nearness by depth and yaw rate by a gyro: the measures of real recordings, on drawn images."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from perceive_images import HEIGHT, WIDTH, save, texture, wall_at

from navfw.bench import (
    camera_way,
    nearness_errors,
    posed_images,
    recorded_gyro,
    yaw_rates,
    yaw_summary,
)
from navfw.errors import ConfigError
from navfw.perceive import PairResult, Perceiver, PerceiverOptions, WorkingSize, open_source
from navfw.plugins import default_registry

STEP = 0.05
"""Distance [m] that the camera travels between two images."""


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


def test_the_way_between_two_poses() -> None:
    past, now = np.eye(4), np.eye(4)
    now[:3, 3] = (3.0, 0.0, 4.0)
    assert camera_way(past, now) == 5.0


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
    turned = replace(approached[0], time=0.2, dt=0.1, rotation_vector=np.array([0.0, 0.0, 0.04]))
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
