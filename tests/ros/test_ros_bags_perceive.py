"""A bag as a source of ``navfw perceive``: its tables are those of a folder."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from bag_samples import Sent, image, imu, odometry, write_bag

from navfw.perceive.bag_source import unpacked_bag
from navfw.recording import Bag

NOISE = np.random.default_rng(3).integers(0, 256, (120, 260), np.uint8)
WIDE = np.asarray(cv2.GaussianBlur(NOISE, (5, 5), 2), np.uint8)
SCENE = np.ascontiguousarray(WIDE[:, :160])


def test_a_gyro_with_one_axis_and_wheels_are_the_tables_of_a_folder(tmp_path: Path) -> None:
    sent: list[Sent] = []
    for k in range(30):
        time = 0.1 * k
        sent += [imu(time, (math.nan, math.nan, 0.3)), image("/c", time, SCENE, "mono8")]
    bag = Bag(write_bag(tmp_path / "one.mcap", sent))
    with unpacked_bag(bag) as files:
        record = files.record
    assert files.lens is None
    assert record is not None and record.source == "gyro"
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
        assert files.record is not None and files.record.source == "gyro"
        assert files.lens is not None and files.lens.size == (160, 120)
    assert any("contradicts the wheels" in note for note in bag.notes)
    moving = [s for s in sent if s.topic != "/c"]
    moving += [
        image("/c", 0.1 * k, np.ascontiguousarray(WIDE[:, 3 * k : 3 * k + 160]), "mono8")
        for k in range(30)
    ]
    with unpacked_bag(Bag(write_bag(tmp_path / "moves.db3", moving))) as files:
        poses = files.record
    assert poses is not None
    way, turned = poses.translation_between(1.0, 2.0), poses.rotation_between(1.0, 2.0)
    assert way is not None and turned is not None
    assert float(np.linalg.norm(way)) == pytest.approx(0.5, rel=0.02)
    assert turned.tolist() == pytest.approx([0.0, 0.0, 0.3], abs=1e-6)
