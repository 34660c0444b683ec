"""Recorded poses of the camera as rotation and translation between images."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfw.errors import InputError
from navfw.numerics import Array
from navfw.perceive import MotionRecord, PerceiverOptions, load_pose_record

START = 1305031449.0
LINE = "0 0 0 0 0 0 0 1\n"


class Images:
    """Stands for a source of images: their times alone."""

    def __init__(self, start: float | None, duration: float, rate_known: bool = True) -> None:
        self.start = start
        self.duration = duration
        self.rate_known = rate_known


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    return path


def trajectory(
    tmp_path: Path, rates: Array, velocity: Array, missing: range = range(0), start: float = 0.0
) -> Path:
    """Ten seconds at 20 Hz: constant ``rates`` (3,) [rad/s] and ``velocity`` (3,) [m/s].

    Both are along the camera's axes, from any pose in the world.
    """
    first = Rotation.from_euler("xyz", [0.3, -1.1, 2.0])
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for k in range(200):
        if k in missing:
            continue
        t = 0.05 * k
        numbers = [*first.apply(velocity * t), *(first * Rotation.from_rotvec(rates * t)).as_quat()]
        lines.append(" ".join(f"{number:.9f}" for number in (start + t, *numbers)))
    return written(tmp_path, "\n".join(lines))


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        ([0.2, 0.0, 0.0], [0.0, -0.2, 0.0]),  # about the axis to the right: nose up
        ([0.0, 0.2, 0.0], [0.0, 0.0, -0.2]),  # about the axis downward: to the right
        ([0.0, 0.0, 0.2], [0.2, 0.0, 0.0]),  # about the axis ahead: right side down
    ],
)
def test_rotation_about_the_axes_of_base_link(
    tmp_path: Path, axis: list[float], expected: list[float]
) -> None:
    record = load_pose_record(trajectory(tmp_path, np.array(axis), np.zeros(3)))
    found = record.rotation_between(2.013, 3.013)
    assert found == pytest.approx(expected, abs=1e-6)


def test_pitch_of_the_camera_is_taken_into_account(tmp_path: Path) -> None:
    # a camera 30 degrees nose down, on a base that turns left and rolls ahead
    down = math.radians(30.0)
    left = 0.2 * np.array([0.0, -math.cos(down), -math.sin(down)])
    ahead = 0.5 * np.array([0.0, -math.sin(down), math.cos(down)])
    record = load_pose_record(trajectory(tmp_path, left, np.zeros(3)), down)
    assert record.rotation_between(1.0, 2.0) == pytest.approx([0.0, 0.0, 0.2], abs=1e-6)
    record = load_pose_record(trajectory(tmp_path, np.zeros(3), ahead), down)
    assert record.translation_between(1.0, 3.0) == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)


def test_speed_of_the_poses_unless_one_is_given(tmp_path: Path) -> None:
    path = trajectory(tmp_path, np.array([0.0, 0.1, 0.0]), np.array([0.3, 0.0, 0.4]))
    record = load_pose_record(path)
    assert PerceiverOptions(gyro=record).speed_between(1.0, 1.1) == pytest.approx(0.5, rel=1e-4)
    assert PerceiverOptions(gyro=record, speed=0.8).speed_between(1.0, 1.1) == 0.8
    assert PerceiverOptions(gyro=record).speed_between(20.0, 20.1) is None
    assert PerceiverOptions().speed_between(1.0, 1.1) is None


def test_names_of_the_columns_and_commas(tmp_path: Path) -> None:
    text = "time,tx,ty,tz,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,2,0,0,0,1\n"
    record = load_pose_record(written(tmp_path, text))
    assert record.translation_between(0.0, 0.5) == pytest.approx([1.0, 0.0, 0.0])


def test_a_jump_is_no_speed(tmp_path: Path) -> None:
    text = "".join(f"{k} 0 0 {z} 0 0 0 1\n" for k, z in enumerate((0, 50, 100, 550)))
    options = PerceiverOptions(gyro=load_pose_record(written(tmp_path, text)))
    assert options.speed_between(0.1, 0.2) == pytest.approx(50.0)
    assert options.speed_between(2.1, 2.2) is None


def test_gaps_and_ends(tmp_path: Path) -> None:
    path = trajectory(tmp_path, np.array([0.0, 0.1, 0.0]), np.ones(3), missing=range(40, 60))
    record = load_pose_record(path)
    for begin, end in ((1.5, 2.5), (1.96, 2.1), (2.9, 3.1), (9.8, 10.2), (-0.5, 0.5)):
        assert record.rotation_between(begin, end) is None
        assert record.translation_between(begin, end) is None
    assert record.poses_at(1.0) is not None  # the time of a pose
    assert record.poses_at(9.95) is not None
    # an image may be taken just before the first pose
    assert record.rotation_between(-0.02, 0.5) is not None
    assert record.rotation_between(3.0, 9.95) is not None


def test_times_of_the_images_names_or_since_the_first_one(tmp_path: Path) -> None:
    turn = np.array([0.0, -0.1, 0.0])
    stamped: MotionRecord = load_pose_record(trajectory(tmp_path, turn, turn, start=START))
    images = Images(START + 2.0, 5.0)
    found = stamped.on_clock_of(images)  # type: ignore[arg-type]
    assert float(found.times[0]) == pytest.approx(-2.0)
    assert found.rotation_between(0.0, 1.0) == pytest.approx([0.0, 0.0, 0.1], abs=1e-5)
    relative: MotionRecord = load_pose_record(trajectory(tmp_path, turn, turn))
    assert relative.on_clock_of(images) is relative  # type: ignore[arg-type]
    for others in (Images(None, 5.0), Images(START + 100.0, 5.0), Images(None, math.inf)):
        with pytest.raises(InputError, match=r"poses\.txt: --poses: expected readings within the"):
            stamped.on_clock_of(others)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"times of the images are not known.* give --fps or --ti"):
        relative.on_clock_of(Images(None, 5.0, rate_known=False))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LINE, r"poses\.txt: has 1 usable pose; at least two rows of time, tx, ty, tz"),
        ("", "has no usable pose"),
        (LINE + "1 0 0 0 0 0 1\n", r"poses\.txt:2: has 7 values, not 8 \(time, tx, ty, tz,"),
        (LINE + "1 0 0 0 0 0 0 one\n", r"poses\.txt:2: qw: 'one' is not a number"),
        (LINE + "1 0 0 nan 0 0 0 1\n", r"poses\.txt:2: expected finite numbers, positions in met"),
        (LINE + "1 0 0 1e30 0 0 0 1\n", r"poses\.txt:2: expected finite numbers"),
        (LINE + "1 0 0 0 1 0 0 1\n", r"poses\.txt:2: qx qy qz qw have the norm 1\.41, not 1"),
        (LINE + LINE, r"poses\.txt:2: time 0\.000000 s does not come after .*; sort the rows"),
        (LINE + "0.1 0 0 50 0 0 0 1\n", "moves at 500 m/s; expected positions in metres, not mill"),
        (LINE + LINE.replace("0", "500", 1), "poses are 500 s apart; expected times in seconds"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_pose_record(written(tmp_path, text))
