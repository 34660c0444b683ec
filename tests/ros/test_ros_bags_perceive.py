"""A bag as a source of ``navfw perceive``: the same percepts as of its images and tables."""

import csv
import json
import math
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bag_samples import KINDS, Sent, image, imu, odometry, packed_image, write_bag
from cli_calls import output

from navfw.lenses import load_calibration
from navfw.perceive import load_gyro_record, load_pose_record, unpacked_bag
from navfw.recording import Bag

NOISE = np.random.default_rng(3).integers(0, 256, (120, 260), np.uint8)
WIDE = np.asarray(cv2.GaussianBlur(NOISE, (5, 5), 2), np.uint8)
SCENE = np.ascontiguousarray(WIDE[:, :160])

DATA = os.environ.get("NAVFW_DATA", "")
"""The folder of recordings that are not part of the repository."""


@pytest.mark.skipif(not DATA, reason="NAVFW_DATA names no folder of recordings")
@pytest.mark.parametrize("kind", KINDS)
def test_a_recorded_car_is_perceived_from_a_bag_as_from_its_folder(
    kind: str, tmp_path: Path
) -> None:
    recording = Path(DATA) / "car_gyro_lab"
    readings = (recording / "readings.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(readings))[530:600]
    start = float(rows[0]["time_s"])
    images = tmp_path / "images"
    images.mkdir()
    sent, times, gyro = [], ["time,file"], ["time,gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s]"]
    for row in rows:
        time = round(float(row["time_s"]) - start, 3)
        file = recording / "images" / f"{row['frame']}_cam_image_array_.jpg"
        rates = [row[f"gyro_{axis}_deg_s"] for axis in "xyz"]
        (images / file.name).write_bytes(file.read_bytes())
        times.append(f"{time},{file.name}")
        gyro.append(",".join([str(time), *rates]))
        way = [float(row[f"accel_{axis}"]) for axis in "xyz"]
        sent.append(packed_image("/camera/compressed", time, file.read_bytes()))
        sent.append(imu(time, [math.radians(float(rate)) for rate in rates], way))
    for name, lines in (("times.csv", times), ("gyro.csv", gyro)):
        (tmp_path / name).write_text("\n".join(lines))
    bag = write_bag(tmp_path / f"car.{kind}", sent)
    of_folder = output(
        "perceive", images, "--times", tmp_path / "times.csv", "--gyro", tmp_path / "gyro.csv",
        "--hfov", "91", "--json", "--quiet",
    )  # fmt: skip
    of_bag = output("perceive", bag, "--hfov", "91", "--json", "--quiet")
    assert percepts(of_bag) == percepts(of_folder)


def percepts(printed: str) -> list[dict[str, Any]]:
    """The results, without the images' names."""
    return [{k: v for k, v in pair.items() if k != "frames"} for pair in json.loads(printed)]


def test_a_gyro_with_one_axis_and_wheels_are_the_tables_of_a_folder(tmp_path: Path) -> None:
    sent: list[Sent] = []
    for k in range(30):
        time = 0.1 * k
        sent += [imu(time, (math.nan, math.nan, 0.3)), image("/c", time, SCENE, "mono8")]
    bag = Bag(write_bag(tmp_path / "one.mcap", sent))
    with unpacked_bag(bag) as files:
        assert files.keys() == {"source", "times", "gyro"}
        record = load_gyro_record(files["gyro"])
    assert record.measured == {"yaw_rate"}
    turned = record.rotation_between(0.5, 1.5)
    assert turned is not None
    assert turned.tolist() == pytest.approx([0.0, 0.0, 0.3])
    # with wheels: their way, and the turns of the gyro
    sent += [odometry(0.1 * k, 0.05 * k, 0.0, 0.0) for k in range(30)]
    info = {"width": 160, "height": 120, "k": np.array([90.0, 0, 80, 0, 90, 60, 0, 0, 1])}
    lens = {"distortion_model": "plumb_bob", "d": np.zeros(5)}
    sent += [Sent("/camera_info", "sensor_msgs/msg/CameraInfo", 0.0, info | lens)]
    # an image that never changes contradicts wheels that move
    bag = Bag(write_bag(tmp_path / "still.bag", sent))
    with unpacked_bag(bag) as files:
        assert files.keys() == {"source", "times", "gyro", "calibration"}
        assert load_calibration(files["calibration"]).size == (160, 120)
    assert any("contradicts the wheels" in note for note in bag.notes)
    moving = [s for s in sent if s.topic != "/c"]
    moving += [
        image("/c", 0.1 * k, np.ascontiguousarray(WIDE[:, 3 * k : 3 * k + 160]), "mono8")
        for k in range(30)
    ]
    with unpacked_bag(Bag(write_bag(tmp_path / "moves.db3", moving))) as files:
        poses = load_pose_record(files["poses"])
    way, turned = poses.translation_between(1.0, 2.0), poses.rotation_between(1.0, 2.0)
    assert way is not None and turned is not None
    assert float(np.linalg.norm(way)) == pytest.approx(0.5, rel=0.02)
    assert turned.tolist() == pytest.approx([0.0, 0.0, 0.3], abs=1e-6)
