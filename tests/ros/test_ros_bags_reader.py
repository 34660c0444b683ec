"""Reading bags: all formats and encodings, choices that are told, and damage of every kind."""

import bz2
import math
import os
import sqlite3
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bag_samples import (
    KINDS,
    ROS1,
    ROS2,
    Sent,
    image,
    imu,
    joints,
    message,
    odometry,
    packed_image,
    twist,
    write_bag,
)
from cli_calls import invoke, refusal
from fuzz_bags import damaged_bags
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from navfw.errors import ConfigError, InputError, NavfwError
from navfw.numerics import Image
from navfw.recording import Bag, driven_way, ros_image
from navfw.recording.ros_messages import message_types

COLOURS = np.random.default_rng(4).integers(0, 256, (6, 8, 3)).astype(np.uint8)


def drive(kind: str, folder: Path, **options: Any) -> Path:
    """A bag with everything in it: two seconds of a robot that turns to the left."""
    sent: list[Sent] = []
    for k in range(40):
        time = 0.05 * k
        sent += [imu(time, (0.01, 0.02, 0.5)), odometry(time, 0.2 * time, 0.0, 0.5 * time)]
        sent += [joints(time, 3.0 * time, 4.0 * time), twist(time, 0.2, 0.5, stamped=k % 2 == 0)]
        sent += [image("/camera/image_raw", time + 0.01, COLOURS, "bgr8")] if k % 2 else []
    return write_bag(folder / f"drive.{kind}", sent, **options)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_each_format_has_the_same_contents(kind: str, tmp_path: Path) -> None:
    bag = Bag(drive(kind, tmp_path))
    times = 0.05 * np.arange(40)
    assert np.allclose(bag.gyro, np.column_stack([times, *np.full((40, 3), (0.01, 0.02, 0.5)).T]))
    assert np.allclose(bag.odometry[:, 3], 0.5 * times)
    assert np.allclose(bag.joints, np.column_stack([times, 3.0 * times, 4.0 * times]))
    assert (bag.commands[:, 1:] == (0.2, 0.5)).all()
    images = list(bag.each_image())
    assert [each.time for each in images] == bag.images[:, 0].tolist()
    assert len(images) == 20
    assert np.array_equal(ros_image(images[3].message, "image"), COLOURS)
    assert bag.duration == pytest.approx(1.96)


@pytest.mark.parametrize(
    ("encoding", "made"),
    [
        ("bgr8", lambda bgr: bgr),
        ("8UC3", lambda bgr: bgr),
        ("rgb8", lambda bgr: bgr[..., ::-1]),
        ("bgra8", lambda bgr: np.dstack([bgr, bgr[..., 0]])),
        ("rgba8", lambda bgr: np.dstack([bgr[..., ::-1], bgr[..., 0]])),
    ],
)
@pytest.mark.parametrize("pad", [0, 5])
def test_colours_of_every_encoding_are_those_that_were_sent(
    encoding: str, made: Any, pad: int
) -> None:
    sent = image("/i", 0.0, np.ascontiguousarray(made(COLOURS)), encoding, pad)
    for types in (ROS1, ROS2):
        assert np.array_equal(ros_image(message(types, sent), "image"), COLOURS)


@pytest.mark.parametrize("encoding", ["bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"])
def test_a_bayer_pattern_shows_the_colour_of_its_letters(encoding: str) -> None:
    letters = encoding[6:10]
    for colour, channel in (("b", 0), ("g", 1), ("r", 2)):
        raw = np.zeros((12, 12), np.uint8)
        for n, letter in enumerate(letters):
            raw[n // 2 :: 2, n % 2 :: 2] = 200 if letter == colour else 0
        seen = ros_image(message(ROS2, image("/i", 0.0, raw, encoding)), "image")[4:8, 4:8]
        assert int(seen.mean(axis=(0, 1)).argmax()) == channel


@given(arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9))), st.integers(0, 3))
def test_a_grey_image_is_the_same_when_it_is_grey_again(grey: Image, pad: int) -> None:
    seen = ros_image(message(ROS2, image("/i", 0.0, grey, "mono8", pad)), "image")
    assert np.array_equal(cv2.cvtColor(seen, cv2.COLOR_BGR2GRAY), grey)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"encoding": "rgb7"}, "unknown encoding 'rgb7': did you mean 'rgb8'"),
        ({"step": 3}, "in rows of 3 for 8 x 6 pixels of bgr8"),
        ({"height": 7}, "has 144 bytes in rows of 24 for 8 x 7"),
        ({"height": 2**32 - 1, "width": 2**32 - 1, "step": 2**32 - 1}, "pixels of bgr8"),
        ({"width": 0}, "for 0 x 6 pixels"),
        ({"encoding": "mono8", "step": 600, "data": np.zeros(3600, np.uint8)}, "rows of 600 for 8"),
    ],
)
def test_an_impossible_image_is_told(fields: dict[str, Any], said: str) -> None:
    sent = image("/i", 0.0, COLOURS, "bgr8")
    made = message(ROS2, sent._replace(fields=sent.fields | fields))
    with pytest.raises(ConfigError, match=said):
        ros_image(made, "image 7")


def test_what_is_left_out_or_chosen_is_told(tmp_path: Path) -> None:
    sent = [odometry(0.1 * k, k, 0.0, 0.0) for k in range(8)]
    sent += [odometry(0.1 * k, k, 0.0, 0.0)._replace(topic="/fused_odom") for k in range(30)]
    sent += [odometry(0.85, math.nan, 0.0, 0.0), odometry(0.9, 9.0, 0.0, 0.0)._replace(stamp=0.3)]
    sent += [imu(0.1 * k, (0.0, 0.0, 0.1))._replace(stamp=0.1 * k - 500.0) for k in range(8)]
    sent += [Sent("/camera_info", "sensor_msgs/msg/CameraInfo", 0.1, {})]
    for kind in KINDS:
        bag = Bag(write_bag(tmp_path / f"odd.{kind}", sent))
        assert bag.odometry[:, 1].tolist() == list(range(8))
        assert bag.gyro[:, 0].tolist() == pytest.approx([0.1 * k for k in range(8)])
        assert bag.info is None
        assert bag.notes == [
            "the clock of /imu is 500 s behind: its messages count from their reception",
            "2 of 10 messages of /odom left out: not finite, or going back",
            "/camera_info is empty: it says nothing of the camera",
            "there are no images",
        ]
        assert [str(each) for each in bag.assumed] == [
            "topic of odometry: /odom, as /fused_odom has such messages too",
            "axes of the gyro: x,y,z are ahead, left, up, as no transform leads from its frame ''"
            " to base_link (--imu-axes)",
        ]


def test_a_topic_that_has_no_images_is_refused(tmp_path: Path) -> None:
    bag = drive("mcap", tmp_path)
    said = refusal("perceive", bag, "--topic", "/camera/image")
    assert (
        "--topic: unknown topic of images '/camera/image': did you mean '/camera/image_raw'" in said
    )
    assert "--topic: is for a bag" in refusal("perceive", tmp_path, "--topic", "/x")


def test_the_way_counts_backward_as_well() -> None:
    yaw = np.full(5, 0.5 * math.pi)
    y = np.array([0.0, 1.0, 2.0, 1.5, 1.0])
    way = driven_way(np.column_stack([np.arange(5.0), np.zeros(5), y, yaw]))
    assert way == pytest.approx([0.0, 1.0, 2.0, 1.5, 1.0])


@pytest.mark.parametrize("mode", ["message", "file"])
def test_packed_bags_are_read(mode: str, tmp_path: Path) -> None:
    assert len(Bag(drive("db3", tmp_path, packed=mode)).gyro) == 40


@pytest.mark.parametrize("excess", [0, 3, 8])
def test_bytes_that_ros_leaves_behind_a_message_are_no_damage(
    excess: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = ROS2.serialize_cdr
    monkeypatch.setattr(ROS2, "serialize_cdr", lambda *m: bytes(packed(*m)) + excess * b"\xab")
    assert len(Bag(drive("mcap", tmp_path)).joints) == 40


def test_nothing_in_a_bag_is_executed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # rosbags makes Python code of the definitions in a bag, and executes it
    def register(*_: object) -> None:
        raise AssertionError("a definition of the bag was used")

    message_types(ros1=True), message_types()
    monkeypatch.setattr("rosbags.typesys.store.Typestore.register", register)
    for kind in KINDS:
        assert len(Bag(drive(kind, tmp_path / kind)).gyro) == 40


def test_a_recording_of_navfw_is_told_from_a_bag(tmp_path: Path) -> None:
    from navfw.recording import RunRecorder

    RunRecorder().save(tmp_path / "run.mcap")
    with pytest.raises(ConfigError, match=r"run\.mcap: not a readable bag: .*navfw export"):
        Bag(tmp_path / "run.mcap")


def test_a_damaged_bag_is_read_or_refused(tmp_path: Path) -> None:
    done: Counter[str] = Counter()
    for path in damaged_bags([drive(kind, tmp_path / kind) for kind in KINDS], 120):
        try:
            for each in Bag(path).each_image():
                ros_image(each.message, each.name)
            done["read"] += 1
        except NavfwError as error:
            assert isinstance(error, InputError)
            done["refused"] += 1
    assert min(done["read"], done["refused"]) > 10


def test_every_kind_of_wrong_file_is_refused(tmp_path: Path) -> None:
    for name, content in (
        ("empty.bag", b""),
        ("text.bag", b"no bag"),
        ("old.bag", b"#ROSBAG V1.2\n"),
        ("packed.bag", bz2.compress(b"#ROSBAG V2.0\n")),
        ("text.mcap", b"no bag"),
        ("text.db3", b"no bag"),
    ):
        (tmp_path / name).write_bytes(content)
        assert f"{name}: not a readable bag: " in refusal("perceive", tmp_path / name)
    with sqlite3.connect(tmp_path / "other.db3") as other:
        other.execute("CREATE TABLE messages (id)")
    other.close()
    assert "not a readable bag" in refusal("replay", tmp_path / "other.db3")
    assert "there is no such file" in refusal("replay", tmp_path / "none.bag")
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("a: 1")
    assert "not a readable bag" in refusal("perceive", folder)
    os.mkfifo(tmp_path / "pipe.bag")
    assert "expected a regular file" in refusal("perceive", tmp_path / "pipe.bag")


def test_a_damaged_image_is_left_out(tmp_path: Path) -> None:
    good = cv2.imencode(".png", cv2.resize(COLOURS, (80, 60)))[1].tobytes()
    sent = [packed_image("/c", 0.1 * k, good if k != 2 else b"\xff\xd8", "png") for k in range(5)]
    done = invoke("perceive", write_bag(tmp_path / "c.mcap", sent), "--json", "--quiet")
    assert done.exit_code == 0, done.output
    assert "1 of 5 images left out" in done.stderr
