"""List the channels of a recording and of the live server: topic, schema, rate and content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntFlag
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from navfw.numerics import Image
    from navfw.recording.top_view import WorldOutline
    from navfw.signals import Pose
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
"""The definition of the message with one sensor reading, in ROS 2's language."""

DECISION_NAME = "navfw_msgs/msg/Decision"

DECISION_SCHEMA = """\
string values      # JSON: what behaviours and fusion knew, and the command that they gave
float64[] numbers  # free distances, conflicts with moving obstacles, obstacles in the image
uint8[] labels     # of the percept's cells
"""
"""The definition of the message with the context of one decision."""


class ImageFlags(IntFlag):
    """Flags of the images that belong to a reading."""

    CAMERA = 1
    LANDMARKS = 2
    SIDES = 4


MAX_BYTES = 1 << 30
"""Largest size of a recording [byte]: an hour of 160x120 images at 10 Hz has 0.6 GB."""

FORMAT_VERSION = 2
"""Version of the channels; raised when a replay reads them differently."""
PROFILE = "navfw-"
"""The file's profile (the kind of its content), to which the version is appended."""

RUN = "navfw.run"
"""Name of the MCAP metadata at the begin of the file, which describe the run."""
END = "navfw.end"
"""Name of the MCAP metadata behind the data; if they are missing, the file is incomplete."""


DIGITS = 6
"""Significant digits of the numbers in messages of JSON, which people read."""


class Topic(str):
    """A channel's topic, with the name of its schema, its usual ``rate``, and its ``content``."""

    __slots__ = ("content", "rate", "schema")
    schema: str
    rate: str
    content: str

    def __new__(cls, topic: str, schema: str, rate: str, content: str) -> Self:
        """Make a channel named ``topic``."""
        info = super().__new__(cls, topic)
        info.schema, info.rate, info.content = schema, rate, content
        return info


IMAGE_SCHEMA = "sensor_msgs/msg/CompressedImage"
_ANNOTATIONS, _SCENE = "foxglove.ImageAnnotations", "foxglove.SceneUpdate"
_TWIST = "geometry_msgs/msg/TwistStamped"


READING = Topic(
    "/sensors/reading", SCHEMA_NAME, "60 Hz", "gyro, encoders, and the command of the stack"
)
CAMERA_IMAGE = Topic("/camera/image", IMAGE_SCHEMA, "10 Hz", "the camera's image, PNG")
LANDMARK_IMAGE = Topic(
    "/camera/landmarks/image", IMAGE_SCHEMA, "1.25 Hz", "the larger image for landmarks, if any"
)
LEFT_IMAGE = Topic("/camera/left/image", IMAGE_SCHEMA, "10 Hz", "left side view, of a wide lens")
RIGHT_IMAGE = Topic("/camera/right/image", IMAGE_SCHEMA, "10 Hz", "right side view, of a wide lens")
CHASE_IMAGE = Topic(
    "/chase/image", IMAGE_SCHEMA, "at most 15 % of the time", "from behind, JPEG; live only"
)
SIDE_IMAGES = (LEFT_IMAGE, RIGHT_IMAGE)
IMAGES = (CAMERA_IMAGE, LANDMARK_IMAGE, *SIDE_IMAGES)
SENSOR_CHANNELS = (READING, *IMAGES)
"""The channels that a replay needs, lossless."""

FLOW = Topic("/flow", _ANNOTATIONS, "5 Hz", "derotated flow, lines over the camera's image")
CELLS = Topic("/percept/cells", _ANNOTATIONS, "5 Hz", "what each flow cell shows, by colour")
PERCEPT = Topic("/percept", "navfw.Percept", "5 Hz", "OFFIS: sentence, quadrants, situations")
LOCAL_MAP = Topic("/local_map", "foxglove.Grid", "2 Hz", "`occupancy` in percent, in `odom`")
LOCAL_GOAL = Topic("/local_goal", "foxglove.PoseInFrame", "10 Hz", "local goal, in `base_link`")
OBSTACLES = Topic("/moving_obstacles", _SCENE, "10 Hz", "moving obstacles, with velocity")
TRUE_OBSTACLES = Topic("/moving_obstacles/true", _SCENE, "10 Hz", "those of the simulator, if any")
TRANSFORMS = Topic(
    "/tf", "tf2_msgs/msg/TFMessage", "10 Hz", "`map` to `odom` to `base_link` to `camera`"
)
POSE = Topic("/pose", "foxglove.Odometry", "10 Hz", "estimated pose with covariance, twist")
TRUE_POSE = Topic("/pose/true", "foxglove.PoseInFrame", "10 Hz", "true pose")
PATH = Topic("/path", "foxglove.PosesInFrame", "10 Hz", "estimated position and waypoints ahead")
WORLD = Topic("/world", _SCENE, "0.2 Hz", "walls and furniture")
PROPOSALS = Topic("/proposals", "foxglove.Grid", "5 Hz", "each behaviour's rating of all commands")
COMMAND = Topic(
    "/command", "navfw.Command", "10 Hz", "the command, its leader, weights and reasons"
)
RULES = Topic(
    "/command/rules", "navfw.FiredRules", "10 Hz", "rules that fired, as `navfw explain --json`"
)
DECISION = Topic("/decision", DECISION_NAME, "10 Hz", "what behaviours and fusion knew, bit by bit")
RULE_BASES = Topic(
    "/rules", "navfw.RuleBases", "0.01 Hz", "the rule bases: text, and curves of the inputs"
)
IMU = Topic("/imu", "sensor_msgs/msg/Imu", "60 Hz", "gyro")
JOINTS = Topic("/joint_states", "sensor_msgs/msg/JointState", "60 Hz", "wheels")
ODOMETRY = Topic("/odom", "nav_msgs/msg/Odometry", "10 Hz", "dead reckoning")
TWIST = Topic("/cmd_vel", _TWIST, "60 Hz", "command")
CAMERA_INFO = Topic("/camera/camera_info", "sensor_msgs/msg/CameraInfo", "10 Hz", "camera")
LOG = Topic("/rosout", "rcl_interfaces/msg/Log", "1 Hz", "what it does")
DRIVEN = Topic("/cmd_vel/driven", _TWIST, "10 Hz", "of a bag's replay: the bag's `cmd_vel`")
"""The commands that moved the robot while the stack did not command it."""

CHANNELS = (
    *(*SENSOR_CHANNELS, FLOW, CELLS, PERCEPT, LOCAL_MAP, LOCAL_GOAL, OBSTACLES, TRUE_OBSTACLES),
    *(TRANSFORMS, POSE, TRUE_POSE, PATH, WORLD, PROPOSALS, COMMAND, RULES, DECISION),
    RULE_BASES,
    *(IMU, JOINTS, ODOMETRY, TWIST, CAMERA_INFO, LOG),
)
"""All channels of a run: those that a replay needs, and those for people and tools."""


Discs = Sequence[tuple[float, float, float]]
"""Circles in top view, each x, y, radius [m], in the map frame."""
Chase = Callable[["Pose", Discs], "Image"]
"""Draws the robot at its true pose and the moving obstacles, seen from behind, in BGR."""


@dataclass(frozen=True, slots=True)
class SeenRun:
    """The sources of the channels besides the readings: the stack, and the world around it.

    ``movers`` gives the moving obstacles now; ``chase`` draws views, for the live server only.
    """

    stack: Stack
    outline: WorldOutline
    movers: Callable[[], Discs] = tuple
    chase: Chase | None = None


def nanoseconds(time: float) -> int:
    """Convert simulated ``time`` [s] to MCAP's [ns]; times before the run become 0."""
    return max(0, round(1e9 * time))
