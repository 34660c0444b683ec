"""Tables with times: rates of a gyro, poses of the camera, times of images."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cli_calls import put_file
from hypothesis import given
from hypothesis import strategies as st
from perceive_images import save
from scipy.spatial.transform import Rotation

from navfw.errors import InputError
from navfw.numerics import Array
from navfw.perceive.image_sources import ImageSource, open_source
from navfw.perceive.image_times import load_image_times
from navfw.perceive.motion_record import (
    GyroRecord,
    MotionRecord,
    load_gyro_record,
    load_pose_record,
)
from navfw.perceive.perceiver_options import PerceiverOptions
from navfw.recording.static_frames import axes_of

START = 1305031449.0
LINE = "0 0 0 0 0 0 0 1\n"


# --- rates of a gyro -----------------------------------------------------------------------------


def gyro_of(folder: Path, text: str) -> GyroRecord:
    return load_gyro_record(put_file(folder, "gyro.csv", text))


def poses_of(folder: Path, text: str) -> MotionRecord:
    return load_pose_record(put_file(folder, "poses.txt", text))


@given(st.floats(0.0, 8.0), st.floats(0.01, 2.0), st.floats(-3, 3), st.floats(-1, 1))
def test_linear_rates_are_integrated_exactly(
    begin: float, length: float, rate: float, rise: float
) -> None:
    times = np.linspace(0.0, 10.0, 501)
    rates = np.zeros((501, 3))
    rates[:, 2] = rate + rise * times
    end = begin + length
    turned = GyroRecord(times=times, rates=rates, longest_gap=0.05).rotation_between(begin, end)
    expected = rate * length + rise * (end**2 - begin**2) / 2
    assert turned == pytest.approx([0.0, 0.0, expected], abs=1e-9)


@pytest.mark.parametrize(
    ("begin", "end", "known"),
    [(-0.04, 0.1, True), (-0.06, 0.1, False), (0.8, 1.04, True), (0.8, 1.06, False)],
)
def test_the_ends_of_a_record_may_be_off_by_one_gap(begin: float, end: float, known: bool) -> None:
    times = np.linspace(0.0, 1.0, 21)
    record = GyroRecord(times=times, rates=np.ones((21, 3)), longest_gap=0.051)
    assert (record.rotation_between(begin, end) is not None) is known


@pytest.mark.parametrize(
    ("text", "seconds", "expected", "measured"),
    [
        (
            "# phone\nyaw [rad/s], time (s), Pitch rate\n0.5,0,0.1\n0.5,0.1,0.1\n",
            *(0.1, [0.0, 0.01, 0.05], {"yaw_rate", "pitch_rate"}),
        ),
        ("0,0.5\n0.1,0.5\n0.2,0.5\n", 0.2, [0.0, 0.0, 0.1], {"yaw_rate"}),
        *(
            (
                separator.join(["Time (s)", '"Gyroscope z (rad/s)"\n0', "0.5\n1", "0.5"]),
                *(1.0, [0.0, 0.0, 0.5], {"yaw_rate"}),
            )
            for separator in ",;\t"
        ),
        *(
            (f"t,yaw_rate [{unit}]\n0,90\n1,90\n", 1.0, [0.0, 0.0, np.pi / 2], {"yaw_rate"})
            for unit in ("deg/s", "°/s", "dps")
        ),
    ],
)
def test_columns_by_name_or_position_and_units_by_the_header(
    tmp_path: Path, text: str, seconds: float, expected: list[float], measured: set[str]
) -> None:
    gyro = gyro_of(tmp_path, text)
    assert gyro.measured == measured
    assert gyro.rotation_between(0.0, seconds) == pytest.approx(expected)


def test_units_and_other_columns_by_the_header(tmp_path: Path) -> None:
    header = "frame,time_ms,accel_x,gyro_x_deg_s,gyro_y_mdps,angular_velocity.z [mrad/s]\n"
    gyro = gyro_of(tmp_path, header + "0,0,9,2,3000,40\n1,100,9,2,3000,40\n")
    expected = 0.1 * np.array([np.radians(2.0), np.radians(3.0), 0.04])
    assert gyro.rotation_between(0.0, 0.1) == pytest.approx(expected)
    assert gyro.notes == ("gyro columns not used: frame, accel_x",)
    assert [each.taken for each in gyro.assumed] == ["x,y,z are ahead, left, up"]


def test_offset_of_pitch_rate_is_told_from_pitching(tmp_path: Path) -> None:
    times = np.arange(0.0, 30.0, 0.05)
    pitching = 0.3 * np.sin(2.0 * times)
    rows = [f"{t:.2f},0.2,{0.07 + p:.6f}" for t, p in zip(times, pitching, strict=True)]
    gyro = gyro_of(tmp_path, "time,yaw_rate,pitch_rate\n" + "\n".join(rows)).without_offsets()
    assert gyro.notes[0].startswith("the gyro's pitch rate has an offset of 0.07")
    assert gyro.rates[:, 1] == pytest.approx(pitching, abs=0.01)
    # a turn to the left is not taken for an offset, whichever axis is up
    assert gyro.rates[:, 2] == pytest.approx(0.2)
    text = "time,gyro_y [rad/s],gyro_z [rad/s]\n" + "\n".join(rows)
    lying = load_gyro_record(put_file(tmp_path, "y.csv", text), axes_of("z,x,y")).without_offsets()
    assert lying.measured == {"yaw_rate", "roll_rate"}
    assert lying.rates[:, 2] == pytest.approx(0.2)


def test_gaps_and_missing_numbers(tmp_path: Path) -> None:
    lines = [f"{0.01 * k:.2f},{'nan' if 300 <= k < 340 else 0.2}" for k in range(1000)]
    lines[700] = "7.00,"
    gyro = gyro_of(tmp_path, "\n".join(lines))
    assert gyro.notes == ("41 of 1000 gyro samples are not numbers",)
    for begin, end in ((2.9, 3.1), (3.1, 3.2), (9.5, 10.5), (-1.0, 0.5)):
        assert gyro.rotation_between(begin, end) is None
    # one sample is no gap
    assert gyro.rotation_between(6.95, 7.05) == pytest.approx([0.0, 0.0, 0.02])


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_gyro_record(tmp_path / "nowhere.csv")
    with pytest.raises(InputError, match="expected UTF-8 text"):
        load_gyro_record(put_file(tmp_path, "gyro.csv", bytes(range(128, 256))))


# --- poses of the camera -------------------------------------------------------------------------


def images_from(start: float | None, duration: float = 5.0, rate_known: bool = True) -> Any:
    """Stands for a source of images: their times alone."""
    return SimpleNamespace(start=start, duration=duration, rate_known=rate_known)


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
    return put_file(tmp_path, "poses.txt", "\n".join(lines))


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
    assert record.rotation_between(2.013, 3.013) == pytest.approx(expected, abs=1e-6)


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
    options = PerceiverOptions(gyro=load_pose_record(path))
    assert options.speed_between(1.0, 1.1) == pytest.approx(0.5, rel=1e-4)
    assert replace(options, speed=0.8).speed_between(1.0, 1.1) == 0.8
    assert options.speed_between(20.0, 20.1) is None
    assert PerceiverOptions().speed_between(1.0, 1.1) is None


def test_names_of_the_columns_and_commas(tmp_path: Path) -> None:
    text = "time,tx,ty,tz,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,2,0,0,0,1\n"
    moved = poses_of(tmp_path, text).translation_between(0.0, 0.5)
    assert moved == pytest.approx([1.0, 0.0, 0.0])


def test_a_jump_is_no_speed(tmp_path: Path) -> None:
    text = "".join(f"{k} 0 0 {z} 0 0 0 1\n" for k, z in enumerate((0, 50, 100, 550)))
    options = PerceiverOptions(gyro=poses_of(tmp_path, text))
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
    images = images_from(START + 2.0)
    moved = stamped.on_clock_of(images)
    assert float(moved.times[0]) == pytest.approx(-2.0)
    assert moved.rotation_between(0.0, 1.0) == pytest.approx([0.0, 0.0, 0.1], abs=1e-5)
    relative: MotionRecord = load_pose_record(trajectory(tmp_path, turn, turn))
    assert relative.on_clock_of(images) is relative
    for others in (images_from(None), images_from(START + 100.0), images_from(None, math.inf)):
        with pytest.raises(InputError, match=r"poses\.txt: --poses: expected readings within the"):
            stamped.on_clock_of(others)
    with pytest.raises(InputError, match=r"times of the images are not known.* give --fps or --ti"):
        relative.on_clock_of(images_from(None, rate_known=False))


_GYRO_ERRORS = [
    ("0,0\n1,0\n0.5,0\n", r"gyro\.csv:3: time 0\.500000 s does not come after 1\.0"),
    ("time,yaw\n0,0\n1,abc\n", r"gyro\.csv:3: yaw_rate: 'abc' is not a number"),
    ("time,yow_rate\n", r"gyro\.csv:1: has no column 'yaw_rate' in time, yow_rate; name the one"),
    ("time,pitch\n0,0\n", r"gyro\.csv:1: has no column 'yaw_rate'"),
    ("0,90\n1,90\n", "are these degrees per second"),
    ("0,0\n1\n", r"gyro\.csv:2: has 1 values, not 2"),
    ("0\n1\n", "has 1 columns and no header"),
    ("time,gyro_z,yaw\n0,0,0\n", r"gyro\.csv:1: has several columns of 'yaw_rate'"),
    ("time,yaw_rate [turns]\n0,0\n", r"gyro\.csv:1: unknown unit in 'yaw_rate \[turns\]'; kn"),
    ("0,0\n5,0\n10,0\n", "samples are 5 s apart; .* name it in the header: time_ms"),
    ("", "has no usable gyro sample"),
    ("0,nan\n1,nan\n", "has no usable gyro sample"),
]
_POSE_ERRORS = [
    (LINE, r"poses\.txt: has 1 usable pose; at least two rows of time, tx, ty, tz"),
    ("", "has no usable pose"),
    (LINE + "1 0 0 0 0 0 1\n", r"poses\.txt:2: has 7 values, not 8 \(time, tx, ty, tz,"),
    (LINE + "1 0 0 0 0 0 0 one\n", r"poses\.txt:2: qw: 'one' is not a number"),
    (LINE + "1 0 0 nan 0 0 0 1\n", r"poses\.txt:2: expected finite numbers, positions in met"),
    (LINE + "1 0 0 1e30 0 0 0 1\n", r"poses\.txt:2: tz: expected finite numbers, up to"),
    (LINE + "1 0 0 0 1 0 0 1\n", r"poses\.txt:2: qx qy qz qw have the norm 1\.41, not 1"),
    (LINE + LINE, r"poses\.txt:2: time 0\.000000 s does not come after .*; sort the rows"),
    (LINE + "0.1 0 0 50 0 0 0 1\n", "moves at 500 m/s; expected positions in metres, not mill"),
    (LINE + LINE.replace("0", "500", 1), "poses are 500 s apart; expected times in seconds"),
]


# --- times of images -----------------------------------------------------------------------------

GREY = np.full((48, 64), 90, np.uint8)


def three_images(folder: Path, times: str) -> ImageSource:
    """Three images, at the times of a file with this text."""
    listed = load_image_times(put_file(folder, "times.csv", times))
    return open_source([save(folder / "images", [GREY] * 3)], listed=listed)


@pytest.mark.parametrize(
    "text",
    [
        "5.0\n5.1\n5.3\n",
        "5.0 rgb/image_1.png\n5.1 rgb/image_2.png\n5.3 rgb/image_3.png\n",
        "# a list\n4.9 image_0.png\n5.0 image_1.png\n5.1 image_2.png\n5.3 image_3.png\n",
        "frame,time_ms,speed\n1,5000,0.2\n2,5100,0.2\n3,5300,0.2\n",
        "file, timestamp [s]\nimage_1.png, 5.0\nimage_2.png, 5.1\nimage_3.png, 5.3\n",
    ],
    ids=["times", "tum", "with others", "table", "named"],
)
def test_lists_of_all_forms(tmp_path: Path, text: str) -> None:
    source = three_images(tmp_path, text)
    assert [item.time for item in source] == pytest.approx([0.0, 0.1, 0.3])
    assert source.start == pytest.approx(5.0)
    assert source.rate == pytest.approx(1.0 / 0.15)
    assert source.notes == []


_TIME_ERRORS = [
    ("", r"times\.csv: has no times of images"),
    ("0\n0.1\n", r"times\.csv: --times: has 2 times for 3 images; add a column 'file'"),
    ("0 a.png\n1 b.png\n2 c.png\n", "has no time of 3 of 3 images, such as image_1.png"),
    ("0\n0.2\n0.1\n", r"times\.csv:3: time 0\.1\d* s does not come after 0\.2\d* s; sort the"),
    ("0\n0.1\nlater\n", r"times\.csv:3: time: 'later' is not a time in seconds"),
    ("0\nnan\n1\n", r"times\.csv:2: time: 'nan' is not a time in seconds"),
    ("frame,v\n1,2\n", r"times\.csv:1: has no column 'time' in frame, v; name the one"),
    ("time,file\n0,image_1.png\n1\n", r"times\.csv:3: has 1 values, not 2 \(time, file\)"),
    (
        "0 image_2.png\n1 image_1.png\n2 image_3.png\n",
        r"image_2\.png was not taken after image_1\.png; give the images in the order of time",
    ),
]


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        *((gyro_of, *row) for row in _GYRO_ERRORS),
        *((poses_of, *row) for row in _POSE_ERRORS),
        *((three_images, *row) for row in _TIME_ERRORS),
    ],
)
def test_what_is_wrong_is_said_with_its_line(
    tmp_path: Path, read: Callable[[Path, str], object], text: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_a_video_has_its_own_times(tmp_path: Path) -> None:
    listed = load_image_times(put_file(tmp_path, "times.csv", "0\n1\n"))
    with pytest.raises(InputError, match="--times: is for image files; a video has its own times"):
        open_source([put_file(tmp_path, "film.mp4", "x")], listed=listed)


def test_tables_of_euroc_have_their_header_in_a_comment(tmp_path: Path) -> None:
    stamps = [1403636579763555584 + 50_000_000 * k for k in range(3)]
    header = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    rows = [f"{stamp},0.1,0.2,0.3,9.8,0,0" for stamp in stamps]
    text = header + "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\r\n" + "\r\n".join(rows)
    gyro = gyro_of(tmp_path, text)
    assert gyro.rates.tolist() == [[0.1, 0.2, 0.3]] * 3
    assert np.diff(gyro.times) == pytest.approx([0.05, 0.05])
    assert [each.what for each in gyro.assumed] == ["axes of the gyro"]
    given = load_gyro_record(put_file(tmp_path, "imu.csv", text), axes_of("z,-y,x"))
    assert given.rates[0].tolist() == [0.3, -0.2, 0.1]
    assert given.assumed == ()
    header = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
    header += "q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1], b_w_RS_S_x [rad s^-1]\n"
    rows = [f"{stamp},1,2,{k},0.8,0.6,0,0,5,5" for k, stamp in enumerate(stamps)]
    poses = load_pose_record(put_file(tmp_path, "truth.csv", header + "\n".join(rows)))
    assert poses.quaternions.tolist() == [[0.6, 0.0, 0.0, 0.8]] * 3
    assert poses.places.tolist() == [[1.0, 2.0, 0.0], [1.0, 2.0, 1.0], [1.0, 2.0, 2.0]]
    said = [str(each) for each in poses.assumed]
    assert "unit of times: ns, as " in said[0]
    assert said[1].startswith("axes of the poses: z,-x,-y are ahead, left, up, as its columns are")


@pytest.mark.parametrize(
    ("text", "seconds", "unit"),
    [
        (
            "#timestamp [ns],filename\n1403636579763555584,1.png\n1403636579813555584,2.png\n",
            0.05,
            "",
        ),
        ("timestamp,filename\n1403636579763555584,1.png\n1403636579813555584,2.png\n", 0.05, "ns"),
        ("1403636579763,1.png\n1403636579863,2.png\n", 0.1, "ms"),
        (
            "# color\n# timestamp filename\n1305031452.7 rgb/1.png\n1305031452.9 rgb/2.png",
            0.2,
            "",
        ),
        ("time_s,file\n0,1.png\n5,2.png\n", 5.0, ""),
        ("time [ms],file\n0,1.png\n33,2.png\n", 0.033, ""),
    ],
)
def test_units_of_image_times(text: str, seconds: float, unit: str, tmp_path: Path) -> None:
    listed = load_image_times(put_file(tmp_path, "data.csv", text))
    assert listed.times[1] - listed.times[0] == pytest.approx(seconds, abs=1e-6)
    assert list(listed.by_name) == ["1.png", "2.png"]
    assert [each.taken for each in listed.assumed] == ([unit] if unit else [])


def test_image_times_that_cannot_be_seconds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"images are 33 s apart; .* name it in the header"):
        load_image_times(put_file(tmp_path, "data.csv", "0,1.png\n33,2.png\n66,3.png\n"))


@pytest.mark.parametrize(
    "text",
    [
        '"Time (s)";"Gyroscope z (rad/s)"\n0,00E0;5,0E-1\n1,00E0;5,0E-1\n',
        "%time,field.header.stamp,field.angular_velocity.z\n17{0},1,.5\n17{1},2,.5\n",
        "# id timestamp ang_vel_x ang_vel_y ang_vel_z\n0 8.5 0 0 .5\n1 9.5 0 0 .5\n",
    ],
    ids=["decimal commas", "rostopic echo -p", "UZH-FPV"],
)
def test_rates_as_other_programs_write_them(text: str, tmp_path: Path) -> None:
    gyro = gyro_of(tmp_path, text.format("0" * 17, "000000005" + "0" * 8))
    assert gyro.measured >= {"yaw_rate"}
    assert gyro.rates[:, 2].tolist() == [0.5, 0.5]
    assert 0.0 < gyro.times[1] - gyro.times[0] <= 1.0


def test_a_list_with_numbers_of_images_has_its_times_in_the_named_column(tmp_path: Path) -> None:
    text = "# id timestamp image_name\n0 5.5 img/1.png\n1 5.6 img/2.png\n"
    listed = load_image_times(put_file(tmp_path, "left_images.txt", text))
    assert listed.by_name == {"1.png": 5.5, "2.png": 5.6}
