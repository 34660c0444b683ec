"""The axes of a bag's gyro: by transforms, by names, by an option, and as other sensors turn."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_samples import ROS1, ROS2, Sent, blank, fill, imu, odometry, write_bag
from bag_swing import YAW, swinging
from cli_calls import answer, invoke, refusal
from scipy.spatial.transform import Rotation

from navfw.errors import InputError
from navfw.numerics import Array
from navfw.recording import Bag
from navfw.recording.static_frames import AXES, OPTICAL, agreeing_axes, axes_of, axes_text


def transform(topic: str, parent: str, child: str, turn: Array, types: Any = ROS2) -> Sent:
    """A message with one transform, whose rotation has ``child``'s axes as columns."""
    link = blank(types, "geometry_msgs/msg/TransformStamped")
    x, y, z, w = Rotation.from_matrix(turn).as_quat().tolist()
    rotation = {"x": x, "y": y, "z": z, "w": w}
    names = {"header": {"frame_id": parent}, "child_frame_id": child}
    fill(link, names | {"transform": {"rotation": rotation}})
    return Sent(topic, "tf2_msgs/msg/TFMessage", 0.0, {"transforms": [link]})


def yaw_rates(bag: Bag) -> Array:
    return bag.gyro[:, 3]


TILTED = Rotation.from_euler("xyz", [0.4, -0.3, 2.0]).as_matrix()


@pytest.mark.parametrize("topic", ["/tf_static", "/tf"])
def test_axes_of_transforms_lead_to_base_link(topic: str, tmp_path: Path) -> None:
    mount = [
        transform(topic, "base_link", "camera_link", np.eye(3)),
        transform(topic, "/camera_link", "cam", OPTICAL),
        transform(topic, "camera_link", "imu", TILTED)._replace(time=0.001),
    ]
    bag = Bag(write_bag(tmp_path / "tf.mcap", [*swinging(TILTED), *mount]))
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))
    assert np.abs(bag.gyro[:, 1:3]).max() < 1e-9
    assert bag.assumed == []
    assert bag.optical == pytest.approx(OPTICAL)
    # a camera's frame that is none of optics: its x axis is ahead
    odd = [*mount[:1], transform(topic, "camera_link", "cam", np.eye(3)), mount[2]]
    assert Bag(
        write_bag(tmp_path / "odd.mcap", [*swinging(TILTED), *odd])
    ).optical == pytest.approx(OPTICAL)
    # without base_link both hang on the camera's frame
    bag = Bag(write_bag(tmp_path / "no_base.mcap", [*swinging(TILTED), *mount[1:]]))
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))


@pytest.mark.parametrize("kind", ["tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"])
def test_transforms_of_ros_1_are_read(kind: str, tmp_path: Path) -> None:
    mount = transform("/tf", "base_link", "imu", TILTED, ROS1)._replace(kind=kind)
    bag = Bag(write_bag(tmp_path / "a.bag", [*swinging(TILTED), mount]))
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))
    assert bag.assumed == []


def test_axes_by_the_name_of_the_frame_and_by_the_option(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.mcap", swinging(OPTICAL, "camera_imu_optical_frame"))
    bag = Bag(path)
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))
    assert [each.taken for each in bag.assumed] == ["z,-x,-y are ahead, left, up"]
    path = write_bag(tmp_path / "b.mcap", swinging(OPTICAL, "imu"))
    assert np.abs(yaw_rates(Bag(path))).max() < 1e-9
    bag = Bag(path, imu_axes="z,-x,-y")
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))
    assert bag.assumed == []


def test_axes_in_which_the_gyro_turns_as_the_wheels_do(tmp_path: Path) -> None:
    axes = axes_of("y,z,x")
    turning = [odometry(0.1 * k, 0.02 * k, 0.0, float(yaw)) for k, yaw in enumerate(YAW)]
    bag = Bag(write_bag(tmp_path / "wheels.mcap", [*swinging(axes), *turning]))
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))
    assert "as it then turns as the wheels do" in str(bag.assumed[0])


@pytest.mark.parametrize(
    "axes",
    ["z,-x,-y", *(pytest.param(axes, marks=pytest.mark.slow) for axes in ("x,-y,-z", "-z,y,x"))],
)
def test_axes_in_which_the_gyro_turns_as_the_images_do(axes: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.mcap", swinging(axes_of(axes)))
    views = answer("perceive", path, "--hfov", "90")
    said = [each for each in views[0]["assumed"] if each["what"] == "axes of the gyro"]
    assert len(said) == 1
    assert "it then turns as the images do" in said[0]["reason"]
    yaw = np.degrees(np.interp([v["time"] for v in views], 0.1 * np.arange(41), YAW))
    for view, end in zip(views, yaw, strict=True):
        begin = np.degrees(np.interp(view["time"] - view["dt"], 0.1 * np.arange(41), YAW))
        assert view["rotation_deg"]["yaw"] == pytest.approx(end - begin, abs=0.4, rel=0.1)
    given = invoke("perceive", path, "--hfov", "90", "--imu-axes", "x,y,z")
    assert "note: the gyro and the images do not turn alike" in given.stderr
    assert "they would with --imu-axes" in given.stderr


def test_a_topic_without_rates_is_no_gyro(tmp_path: Path) -> None:
    absent = {"angular_velocity_covariance": np.array([-1.0, *[0.0] * 8])}
    sent = swinging(np.eye(3))
    rates = [each for each in sent if each.topic == "/imu"]
    still = [imu(0.05 * k, (0.0, 0.0, 0.0))._replace(topic="/imu/accel") for k in range(80)]
    none = [each._replace(topic="/camera/imu", fields=each.fields | absent) for each in rates]
    both = [each._replace(topic="/gyro/sample") for each in rates]
    bag = Bag(write_bag(tmp_path / "a.mcap", [*sent[::2], *still, *none, *both]))
    assert yaw_rates(bag) == pytest.approx(np.gradient(YAW, 0.1))
    assert sum("has no rates of rotation: it is not taken as a gyro" in n for n in bag.notes) == 2
    bag = Bag(write_bag(tmp_path / "b.mcap", [*sent[::2], *still, *none]))
    assert len(bag.gyro) == 0


def test_axes_have_names_and_only_they(tmp_path: Path) -> None:
    assert len({axes_text(axes) for axes in AXES}) == 24
    for axes in AXES:
        assert np.array_equal(axes_of(f" {axes_text(axes).upper()}"), axes)
    for wrong in ("z,x", "x,x,z", "x,y,-z", "1,2,3", ""):
        with pytest.raises(InputError, match="--imu-axes: expected which of its axes"):
            axes_of(wrong)
    path = write_bag(tmp_path / "a.mcap", swinging(np.eye(3))[:6])
    assert "got 'north'" in refusal("perceive", path, "--imu-axes", "north")


def test_axes_that_may_be_right_are_kept() -> None:
    rng = np.random.default_rng(2)
    turns: Any = rng.normal(size=(20, 3))
    assert np.array_equal(AXES[0], np.eye(3))
    for axes in AXES[1:]:
        found, agreement = agreeing_axes(turns @ axes.T, turns)
        assert found is not None
        assert np.array_equal(found, axes)
        assert agreement == pytest.approx(1.0)
    assert agreeing_axes(turns, turns)[0] is None
    assert agreeing_axes(turns, rng.normal(size=(20, 3)))[0] is None
