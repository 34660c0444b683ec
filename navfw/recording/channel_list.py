"""The channels of a recording and of the live server: topic, schema, rate and content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navfw.recording.top_view import WorldOutline
    from navfw.stack import Stack

SCHEMA_NAME = "navfw_msgs/msg/SensorReading"

SCHEMA = """\
float64 time                 # simulated time of the control tick [s]
float64 roll_rate            # gyro [rad/s]
float64 pitch_rate
float64 yaw_rate
float64 inertial_time        # time of the gyro's measurement [s]
float64 encoders_time        # time of the encoders' measurement [s]
int64 left                   # wheel ticks since power-on
int64 right
float64 frame_time           # time of the camera image of this tick [s], 0 without one
float64 landmark_frame_time  # time of the larger image for landmarks [s], 0 without one
int64 pictures               # images of this tick: 1 camera, 2 landmarks, 4 side views
float64 v                    # the stack's command [m/s]
float64 w                    # the stack's command [rad/s]
"""
"""The ROS 2 definition of the message."""


class ImageFlags(IntFlag):
    """The images that belong to a reading."""

    CAMERA = 1
    LANDMARKS = 2
    SIDES = 4


MAX_BYTES = 1 << 30
"""Largest size of a recording [byte]: an hour of 160x120 images at 10 Hz has 0.6 GB."""

FORMAT_VERSION = 2
"""Version of the channels; raised when a replay reads them differently."""
PROFILE = "navfw-"
"""Profile of the file, before the version."""

RUN = "navfw.run"
"""Name of the metadata that describe the run, at the begin of the file."""
END = "navfw.end"
"""Name of the metadata at the end of the data; without them the run is not complete."""

READING = "/sensors/reading"
CAMERA_IMAGE = "/camera/image"
LANDMARK_IMAGE = "/camera/landmarks/image"
LEFT_IMAGE = "/camera/left/image"
RIGHT_IMAGE = "/camera/right/image"
SIDE_IMAGES = (LEFT_IMAGE, RIGHT_IMAGE)
IMAGES = (CAMERA_IMAGE, LANDMARK_IMAGE, *SIDE_IMAGES)
FLOW = "/flow"
CELLS = "/percept/cells"
PERCEPT = "/percept"
LOCAL_MAP = "/local_map"
LOCAL_GOAL = "/local_goal"
OBSTACLES = "/moving_obstacles"
TRUE_OBSTACLES = "/moving_obstacles/true"
TRANSFORMS = "/tf"
POSE = "/pose"
TRUE_POSE = "/pose/true"
PATH = "/path"
WORLD = "/world"
PROPOSALS = "/proposals"
COMMAND = "/command"
RULES = "/command/rules"
IMU = "/imu"
JOINTS = "/joint_states"
ODOMETRY = "/odom"
TWIST = "/cmd_vel"
DRIVEN = "/cmd_vel/driven"
CAMERA_INFO = "/camera/camera_info"
LOG = "/rosout"


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A channel: its ``topic``, the name of its ``schema``, how often, and what is in it."""

    topic: str
    schema: str
    rate: str
    content: str


_ANNOTATIONS = "foxglove.ImageAnnotations"
IMAGE_SCHEMA = "sensor_msgs/msg/CompressedImage"

SENSOR_CHANNELS = (
    ChannelInfo(READING, SCHEMA_NAME, "60 Hz", "gyro, encoders, and the command of the stack"),
    ChannelInfo(CAMERA_IMAGE, IMAGE_SCHEMA, "10 Hz", "the camera's image, PNG"),
    ChannelInfo(LANDMARK_IMAGE, IMAGE_SCHEMA, "1.25 Hz", "the larger image for landmarks, if any"),
    ChannelInfo(LEFT_IMAGE, IMAGE_SCHEMA, "10 Hz", "left side view, of a wide lens"),
    ChannelInfo(RIGHT_IMAGE, IMAGE_SCHEMA, "10 Hz", "right side view, of a wide lens"),
)
"""What a replay needs, bit for bit."""

VIEWER_CHANNELS = (
    ChannelInfo(FLOW, _ANNOTATIONS, "5 Hz", "derotated flow, lines over the camera's image"),
    ChannelInfo(CELLS, _ANNOTATIONS, "5 Hz", "what each flow cell shows, by colour"),
    ChannelInfo(PERCEPT, "navfw.Percept", "5 Hz", "OFFIS: sentence, quadrants, situations"),
    ChannelInfo(LOCAL_MAP, "foxglove.Grid", "2 Hz", "`occupancy` in percent, in `odom`"),
    ChannelInfo(LOCAL_GOAL, "foxglove.PoseInFrame", "10 Hz", "local goal, in `base_link`"),
    ChannelInfo(OBSTACLES, "foxglove.SceneUpdate", "10 Hz", "moving obstacles, with velocity"),
    ChannelInfo(TRUE_OBSTACLES, "foxglove.SceneUpdate", "10 Hz", "those of the simulator, if any"),
    ChannelInfo(
        TRANSFORMS,
        "tf2_msgs/msg/TFMessage",
        "10 Hz",
        "`map` to `odom` to `base_link` to `camera`",
    ),
    ChannelInfo(POSE, "foxglove.Odometry", "10 Hz", "estimated pose with covariance, twist"),
    ChannelInfo(TRUE_POSE, "foxglove.PoseInFrame", "10 Hz", "true pose"),
    ChannelInfo(PATH, "foxglove.PosesInFrame", "10 Hz", "estimated position and waypoints ahead"),
    ChannelInfo(WORLD, "foxglove.SceneUpdate", "0.2 Hz", "walls and furniture"),
    ChannelInfo(PROPOSALS, "foxglove.Grid", "5 Hz", "each behaviour's rating of all commands"),
    ChannelInfo(COMMAND, "navfw.Command", "10 Hz", "the command, its leader, weights and reasons"),
    ChannelInfo(RULES, "navfw.FiredRules", "5 Hz", "rules that fired, as `navfw explain --json`"),
    ChannelInfo(IMU, "sensor_msgs/msg/Imu", "60 Hz", "gyro"),
    ChannelInfo(JOINTS, "sensor_msgs/msg/JointState", "60 Hz", "wheels"),
    ChannelInfo(ODOMETRY, "nav_msgs/msg/Odometry", "10 Hz", "dead reckoning"),
    ChannelInfo(TWIST, "geometry_msgs/msg/TwistStamped", "60 Hz", "command"),
    ChannelInfo(CAMERA_INFO, "sensor_msgs/msg/CameraInfo", "10 Hz", "camera"),
    ChannelInfo(LOG, "rcl_interfaces/msg/Log", "1 Hz", "what it does"),
)
"""What people and tools look at."""
DRIVEN_CHANNEL = ChannelInfo(
    DRIVEN, "geometry_msgs/msg/TwistStamped", "10 Hz", "of a bag's replay: the bag's `cmd_vel`"
)
"""What the robot was commanded in its stead while the stack was not in command."""

CHANNELS = SENSOR_CHANNELS + VIEWER_CHANNELS
"""All channels of a run."""


@dataclass(frozen=True, slots=True)
class SeenRun:
    """What the channels show besides the readings: the stack at work, and the world around it.

    ``movers`` gives the true discs x, y, radius [m, map frame] of what moves by itself.
    """

    stack: Stack
    outline: WorldOutline
    movers: Callable[[], Sequence[tuple[float, float, float]]] = tuple


def nanoseconds(time: float) -> int:
    """Simulated ``time`` [s] as MCAP counts it [ns]; times before the run count as its start."""
    return max(0, round(1e9 * time))
