"""Sensors of bags as they are: other clocks, units, robots, joints, and poses that are none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_samples import Sent, imu, joints, odometry, write_bag
from bag_swing import YAW, swinging
from cli_calls import answer, invoke
from scipy.spatial.transform import Rotation

from navfw.recording import Bag
from navfw.recording.static_frames import OPTICAL

RATES = np.gradient(YAW, 0.1)
SWINGING = swinging(np.eye(3))
IMAGES = [each for each in SWINGING if each.topic != "/imu"]
TURNS = [odometry(0.1 * k, 0.02 * k, 0.0, float(yaw)) for k, yaw in enumerate(YAW)]


def test_a_simulation_that_is_slower_than_the_recorder_keeps_its_own_time(tmp_path: Path) -> None:
    sent = [*SWINGING, *TURNS, imu(1.0, (0, 0, 9))._replace(topic="/imu/other")]
    slow = [s._replace(time=2.0 * s.time, stamp=s.time - 1.7e9 + 10.0) for s in sent]
    command = {"linear": {"x": 0.2}, "angular": {}}
    slow += [Sent("/cmd_vel", "geometry_msgs/msg/Twist", 0.2 * k, command) for k in range(1, 40)]
    whole, bag = Bag(write_bag(tmp_path / "a.mcap", sent)), Bag(write_bag(tmp_path / "b.bag", slow))
    for one, other in ((whole.gyro, bag.gyro), (whole.odometry, bag.odometry)):
        assert other == pytest.approx(one, abs=1e-6)
    assert bag.images[:, 0] == pytest.approx(whole.images[:, 0], abs=1e-6)
    assert bag.duration == pytest.approx(4.0)
    assert bag.commands[:, 0] == pytest.approx(0.1 * np.arange(1, 40), abs=1e-6)
    assert "the clock of /cam/image is 1.7e+09 s behind the bag's: times are its own" in bag.notes


def test_stamps_that_stand_still_are_no_clock(tmp_path: Path) -> None:
    sent = [s._replace(stamp=-1.7e9) for s in SWINGING]
    bag = Bag(write_bag(tmp_path / "a.mcap", sent))
    assert bag.images[:, 0] == pytest.approx(0.1 * np.arange(41), abs=1e-6)
    assert "its messages count from their reception" in bag.notes[0]


def test_a_gyro_in_degrees_is_not_taken(tmp_path: Path) -> None:
    fast = [imu(0.1 * k, (0.0, 0.0, float(np.degrees(rate)))) for k, rate in enumerate(RATES)]
    bag = Bag(write_bag(tmp_path / "fast.mcap", [*IMAGES, *fast]))
    assert len(bag.gyro) == 0
    assert "/imu has rates of 26 rad/s, as if in degrees: it is not taken as a gyro" in bag.notes
    # as slow as a robot's in radians: it contradicts the images
    slow = [imu(0.1 * k, (0.0, 0.0, 20.0 * float(rate))) for k, rate in enumerate(RATES)]
    done = invoke("perceive", write_bag(tmp_path / "slow.mcap", [*IMAGES, *slow]), "--hfov", "90")
    assert "the gyro and the images do not turn alike (agreement 0.1" in done.stderr
    views = answer("perceive", tmp_path / "slow-mcap", "--hfov", "90")
    assert {view["rotation_deg"]["source"] for view in views} == {"flow"}


def test_a_gyro_whose_clock_lags_is_doubted(tmp_path: Path) -> None:
    late = [imu(0.1 * k - 0.35, (0.0, 0.0, float(rate))) for k, rate in enumerate(RATES)]
    late = [each._replace(time=0.1 * k, stamp=each.time) for k, each in enumerate(late)]
    done = invoke("perceive", write_bag(tmp_path / "a.mcap", [*IMAGES, *late]), "--hfov", "90")
    assert "note: the gyro and the images do not turn alike (agreement 0.7" in done.stderr


def test_sensors_are_those_of_the_robot_with_the_images(tmp_path: Path) -> None:
    own = [each._replace(topic=f"/robot2{each.topic}") for each in [*SWINGING, *TURNS]]
    other = [imu(0.05 * k, (0.0, 0.0, -0.4))._replace(topic="/robot1/imu") for k in range(90)]
    other += [odometry(0.05 * k, k, 0.0, 0.0)._replace(topic="/robot1/odom") for k in range(90)]
    bag = Bag(write_bag(tmp_path / "two.mcap", own + other))
    assert bag.gyro[:, 3] == pytest.approx(RATES)
    assert bag.odometry[:, 3] == pytest.approx(YAW)


def test_wheels_that_are_kept_within_turns_roll_on(tmp_path: Path) -> None:
    rolled = np.linspace(0.0, 40.0, 200)
    for turns in (1.0, 2.0):
        half = turns * np.pi
        kept = (rolled + half) % (2.0 * half) - half
        sent = [joints(0.05 * k, float(angle), -float(angle)) for k, angle in enumerate(kept)]
        bag = Bag(write_bag(tmp_path / f"{turns:.0f}.mcap", sent))
        assert bag.joints[:, 1] == pytest.approx(rolled)
        assert bag.joints[:, 2] == pytest.approx(-rolled)


def test_joints_that_steer_are_no_wheels(tmp_path: Path) -> None:
    names = ["left_steering_hinge", "right_steering_hinge", "arm_left", "rear_left_wheel"]
    fields: dict[str, Any] = {"name": [*names, "rear_right_wheel"]}
    fields["position"] = np.array([0.1, 0.1, 0.5, 3.0, 4.0])
    sent = [Sent("/joint_states", "sensor_msgs/msg/JointState", 0.1 * k, fields) for k in (0, 1)]
    assert Bag(write_bag(tmp_path / "a.mcap", sent)).joints[0, 1:].tolist() == [3.0, 4.0]


def test_poses_that_nobody_fills_in_or_of_a_camera_are_not_the_wheels(tmp_path: Path) -> None:
    still = [odometry(0.1 * k, 0.0, 0.0, 0.0) for k in range(41)]
    bag = Bag(write_bag(tmp_path / "still.mcap", [*IMAGES, *still]))
    assert (len(bag.odometry), bag.notes) == (0, ["poses on /odom never change: they are not used"])
    lying = []
    for each, yaw in zip(TURNS, YAW, strict=True):
        turn = Rotation.from_euler("z", yaw) * Rotation.from_matrix(OPTICAL)
        pose = {"orientation": dict(zip("xyzw", turn.as_quat().tolist(), strict=True))}
        lying.append(each._replace(fields={"pose": {"pose": pose}}))
    bag = Bag(write_bag(tmp_path / "camera.mcap", [*IMAGES, *lying]))
    assert "41 of 41 messages of /odom left out" in bag.notes[0]
