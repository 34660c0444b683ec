"""Messages of ROS to readings of a stack: exact, in order, and judged; without ROS."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from navfw.errors import InputError
from navfw.recording import deserialize_cdr, odometry_message, ros_message
from navfw.recording.ros_messages import image_message, imu_message, joints_message
from navfw.robot import RobotModel
from navfw.ros.sensor_inputs import SensorInputs, posed_goal
from navfw.signals import Encoders, Inertial, Odometry, Pose, SensorReading, Twist
from navfw.topomap import load_map

ROBOT = RobotModel()
CAMERA = ROBOT.camera
IMU, JOINTS = "sensor_msgs/msg/Imu", "sensor_msgs/msg/JointState"
IMAGE, ODOMETRY = "sensor_msgs/msg/Image", "nav_msgs/msg/Odometry"


def nanoseconds(time: float) -> int:
    return round(1e9 * time)


def read_at(time: float, yaw_rate: float = 0.0, left: int = 0, right: int = 0) -> SensorReading:
    return SensorReading(time, Inertial(time, 0.1, -0.2, yaw_rate), Encoders(time, left, right))


def joints(time: float, left: int, right: int) -> Any:
    data = joints_message(ROBOT, read_at(time, 0.0, left, right), nanoseconds(time))
    return deserialize_cdr(data, JOINTS)


def image(time: float, pixels: Any = None, **fields: Any) -> Any:
    grey = np.zeros((CAMERA.height, CAMERA.width), np.uint8) if pixels is None else pixels
    message = deserialize_cdr(image_message(grey, nanoseconds(time)), IMAGE)
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def made(notes: list[str], **options: Any) -> SensorInputs:
    return SensorInputs(ROBOT, notes.append, **options)


def newest(inputs: SensorInputs, silent_at: float | None = None) -> SensorReading:
    """The last of the readings that are due."""
    return list(inputs.readings(silent_at))[-1]


COUNTS = st.integers(-(10**8), 10**8)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(-20, 20), COUNTS, COUNTS)
def test_in_lock_step_readings_come_back_bit_for_bit(
    step: int, rate: float, left: int, right: int
) -> None:
    first, time = read_at(0.0), step / 240.0
    inputs = made([], snap=240.0)
    sent = read_at(time, rate, left, right)
    for reading in (first, sent) if step else (sent,):
        now = nanoseconds(reading.time)
        message = deserialize_cdr(imu_message(ROBOT, reading, now), IMU)
        inputs.imu("imu", message, 0.0)
        wheels = deserialize_cdr(joints_message(ROBOT, reading, now), JOINTS)
        assert inputs.joints("joint_states", wheels, 0.0)
        received = newest(inputs)
    assert received == sent


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.0, 50.0), min_size=1, max_size=30))
def test_time_never_goes_back(times: list[float]) -> None:
    inputs, newest = made([]), -math.inf
    for number, time in enumerate(times):
        if inputs.joints("joint_states", joints(time, number, number), time):
            assert inputs.newest_of("joint_states") > newest
            newest = inputs.newest_of("joint_states")


def test_a_clock_that_begins_anew_goes_on_and_the_wheels_do_not_jump() -> None:
    notes: list[str] = []
    inputs = made(notes)
    for time, ticks in ((100.0, 0), (100.1, 500), (0.0, 0), (0.1, 30)):
        assert inputs.joints("joint_states", joints(time, ticks, ticks), time)
    reading = newest(inputs)
    assert reading.encoders.left == reading.encoders.right == 530
    assert 0.1 < reading.time < 0.4
    assert any("begun anew" in note for note in notes)


def test_silent_wheels_do_not_count_and_what_they_roll_is_lost() -> None:
    inputs = made([])
    inputs.joints("joint_states", joints(1.0, 10, 20), 1.0)
    assert newest(inputs).encoders == Encoders(0.0, 10, 20)
    assert newest(inputs, 0.5).encoders == Encoders(0.5, 10, 20)
    inputs.joints("joint_states", joints(1.6, 400, 500), 1.6)
    inputs.joints("joint_states", joints(1.7, 403, 505), 1.7)
    encoders = newest(inputs).encoders
    assert (encoders.left, encoders.right) == (13, 25)


def test_counts_that_begin_anew_are_taken_as_such_and_odd_ones_left_out() -> None:
    notes: list[str] = []
    inputs, top = made(notes), ROBOT.max_v / (2.0 * math.pi * ROBOT.wheel_radius)
    step = round(0.1 * top * ROBOT.ticks_per_turn)
    counts = (0, step, 10**7, 2 * step, 3 * step, 10**7, 10**7 + step, 10**7 + 2 * step)
    taken = [
        inputs.joints("joint_states", joints(0.1 * number, count, count), 0.1 * number)
        for number, count in enumerate(counts)
    ]
    assert taken == [True, True, False, True, True, False, True, True]
    assert newest(inputs).encoders.left == 4 * step
    assert len(notes) == 2


def test_rates_are_means_over_the_time_that_the_wheels_rolled() -> None:
    inputs = made([])
    for time, rate in ((1.0, 0.0), (1.1, 0.2), (1.2, 0.6)):
        sent = imu_message(ROBOT, read_at(time, rate), nanoseconds(time))
        inputs.imu("imu", deserialize_cdr(sent, IMU), time)
        if time != 1.1:
            inputs.joints("joint_states", joints(time, 1, 1), time)
    assert newest(inputs).inertial.yaw_rate == pytest.approx(0.4)


def test_an_image_between_messages_of_the_wheels_has_a_reading_of_its_own() -> None:
    inputs = made([])
    inputs.joints("joint_states", joints(1.0, 0, 0), 1.0)
    newest(inputs)
    inputs.image("image", image(1.04), 1.04)
    inputs.joints("joint_states", joints(1.1, 10, -20), 1.1)
    inputs.image("image", image(1.12), 1.12)
    inputs.joints("joint_states", joints(1.1 + 1 / 15, 20, 0), 1.17)
    seen = [(r.frame is not None, r.encoders.left, r.encoders.right) for r in inputs.readings()]
    assert seen == [(False, 10, -20), (True, 13, -14), (False, 20, 0)]


def test_an_image_that_is_newer_than_the_wheels_waits_once() -> None:
    inputs, given = made([]), list[bool]()
    for number in range(3):
        time = 1.0 + 0.1 * number
        inputs.image("image", image(time + 0.05), time)
        inputs.joints("joint_states", joints(time, 0, 0), time)
        given.append(newest(inputs).frame is not None)
    assert given == [False, True, False]


def test_stamps_of_another_clock_count_from_reception() -> None:
    notes: list[str] = []
    inputs = made(notes)
    inputs.joints("joint_states", joints(5.0, 0, 0), 5.0)
    inputs.imu("imu", deserialize_cdr(imu_message(ROBOT, read_at(0), nanoseconds(900)), IMU), 5.1)
    assert inputs.newest == pytest.approx(0.1)
    assert "imu is 895 s ahead" in notes[0]


def test_messages_that_come_late_keep_their_stamps_and_their_order() -> None:
    notes: list[str] = []
    inputs = made(notes)
    for taken, came in ((5.0, 5.0), (5.1, 7.0), (5.2, 7.0), (5.3, 7.1), (7.1, 7.1)):
        assert inputs.joints("joint_states", joints(taken, 0, 0), came)
        assert inputs.newest == pytest.approx(taken - 5.0)
    assert not notes


def test_each_image_is_given_once_and_grey() -> None:
    inputs = made([])
    shape = CAMERA.height, CAMERA.width
    pixels = np.arange(CAMERA.height * CAMERA.width, dtype=np.uint8).reshape(shape)
    inputs.image("image", image(1.0, pixels), 1.0)
    frame = newest(inputs, 0.0).frame
    assert frame is not None
    assert np.array_equal(frame.image, pixels)
    assert newest(inputs, 0.1).frame is None


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"encoding": "mono9"}, "unknown encoding 'mono9'"),
        ({"step": 3}, "rows of 3"),
        ({"height": 10**6}, "the image has"),
        ({"height": 10, "data": np.zeros(10 * CAMERA.width, np.uint8)}, "another shape"),
    ],
)
def test_images_that_are_wrong_are_left_out_and_said(fields: Any, said: str) -> None:
    notes: list[str] = []
    inputs = made(notes)
    inputs.image("image", image(1.0, **fields), 1.0)
    assert newest(inputs, 0.0).frame is None
    assert said in notes[0]


def test_numbers_that_are_none_are_left_out_and_said() -> None:
    notes: list[str] = []
    inputs = made(notes)
    wheels = joints(1.0, 3, 3)
    wheels.position = np.array([math.nan, 0.0])
    assert not inputs.joints("joint_states", wheels, 1.0)
    turning = deserialize_cdr(ros_message(IMU, {"angular_velocity": {"z": math.inf}}, 10**9), IMU)
    inputs.imu("imu", turning, 1.0)
    assert len(notes) == 2
    wheels.name = ["a", "b"]
    assert not inputs.joints("joint_states", wheels, 1.0)
    assert "set wheel_joints, of a, b" in notes[2]


def test_rates_are_turned_to_base_link() -> None:
    inputs = made([], imu_rpy=(math.pi, 0.0, 0.0))  # mounted upside down
    rates = {"angular_velocity": {"x": 0.1, "y": 0.2, "z": 0.3}}
    inputs.imu("imu", deserialize_cdr(ros_message(IMU, rates, 10**9), IMU), 1.0)
    inertial = newest(inputs, 0.0).inertial
    assert (inertial.roll_rate, inertial.yaw_rate) == pytest.approx((0.1, -0.3))


def test_odometry_is_ticks_of_both_wheels() -> None:
    inputs = made([])
    for time, pose in ((1.0, Pose(2.0, 1.0, 3.0)), (1.1, Pose(2.0, 1.0, -3.0))):
        at = Odometry(time, pose, Twist(0, 0), 0.0, still=False)
        message = deserialize_cdr(odometry_message(at, nanoseconds(time)), ODOMETRY)
        assert inputs.odometry("odom", message, time)
    encoders = newest(inputs).encoders
    turn = 2.0 * math.pi - 6.0  # through pi
    ticks = 0.5 * ROBOT.track * turn * ROBOT.ticks_per_turn / (2 * math.pi * ROBOT.wheel_radius)
    assert (encoders.left, encoders.right) == (round(-ticks), round(ticks))


def mounted(*links: tuple[str, str, tuple[float, ...]]) -> Any:
    transforms = [
        {
            "header": {"frame_id": parent},
            "child_frame_id": child,
            "transform": {"rotation": dict(zip("xyzw", turn, strict=True))},
        }
        for parent, child, turn in links
    ]
    kind = "tf2_msgs/msg/TFMessage"
    return deserialize_cdr(ros_message(kind, {"transforms": transforms}), kind)


def rates_from(frame: str, time: float = 1.0) -> Any:
    rates = {"x": 0.1, "y": 0.2, "z": 0.3}
    fields = {"header": {"frame_id": frame}, "angular_velocity": rates}
    return deserialize_cdr(ros_message(IMU, fields, nanoseconds(time)), IMU)


UNIT = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: math.hypot(*q) > 0.1)


@settings(max_examples=60, deadline=None)
@given(UNIT, UNIT)
def test_rates_are_turned_to_base_link_by_static_transforms(
    first: list[float], second: list[float]
) -> None:
    one, two = Rotation.from_quat(first), Rotation.from_quat(second)
    notes: list[str] = []
    inputs = made(notes)
    plate = ("/base_link", "plate", tuple(one.as_quat()))
    inputs.mounts(mounted(("plate", "imu_link", tuple(two.as_quat()))))
    inputs.mounts(mounted(plate))
    inputs.imu("imu", rates_from("imu_link"), 1.0)
    inertial = newest(inputs, 0.0).inertial
    turned = (inertial.roll_rate, inertial.pitch_rate, inertial.yaw_rate)
    assert turned == pytest.approx(tuple((one * two).apply([0.1, 0.2, 0.3])))
    assert not notes


@pytest.mark.parametrize(
    "links",
    [
        (),
        (("base_link", "imu_link", (0.0, 0.0, 0.0, 0.0)),),
        (("base_link", "imu_link", (math.nan, 0.0, 0.0, 1.0)),),
        (("imu_link", "imu_link", (0.0, 0.0, 0.0, 1.0)),),
        (("moon", "imu_link", (1.0, 0.0, 0.0, 0.0)),),
    ],
)
def test_an_imu_that_no_transform_leads_to_is_said(links: Any) -> None:
    notes: list[str] = []
    inputs = made(notes)
    inputs.mounts(mounted(*links))
    inputs.imu("imu", rates_from("imu_link"), 1.0)
    assert newest(inputs, 0.0).inertial.yaw_rate == 0.3
    assert any("no transform from 'imu_link' to base_link" in note for note in notes)


@pytest.mark.parametrize(
    ("frame", "x", "why"),
    [("moon", 1.2, "its frame"), ("map", math.nan, "not a number"), ("map", 300.0, "free floor")],
)
def test_goals_off_the_map_are_refused(frame: str, x: float, why: str) -> None:
    kind, office = "geometry_msgs/msg/PoseStamped", load_map("office")
    there = {"header": {"frame_id": frame}, "pose": {"position": {"x": x, "y": 1.2}}}
    with pytest.raises(InputError, match=why):
        posed_goal(office, deserialize_cdr(ros_message(kind, there), kind))
    there = {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.2, "y": 1.2}}}
    goal = posed_goal(office, deserialize_cdr(ros_message(kind, there), kind))
    assert (goal.x, goal.y) == (1.2, 1.2)
