"""The channels of a recording and of the live server: topic, schema, rate and content."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.recording.reading_message import SCHEMA_NAME

READING = "/sensors/reading"
CAMERA_IMAGE = "/camera/image"
LANDMARK_IMAGE = "/camera/landmarks/image"
LEFT_IMAGE = "/camera/left/image"
RIGHT_IMAGE = "/camera/right/image"
FLOW = "/flow"
CELLS = "/percept/cells"
PERCEPT = "/percept"
LOCAL_MAP = "/local_map"
LOCAL_GOAL = "/local_goal"
OBSTACLES = "/moving_obstacles"
TRANSFORMS = "/tf"
POSE = "/pose"
TRUE_POSE = "/pose/true"
PATH = "/path"
WORLD = "/world"
PROPOSALS = "/proposals"
COMMAND = "/command"
RULES = "/command/rules"


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A channel: its ``topic``, the name of its ``schema``, how often, and what is in it."""

    topic: str
    schema: str
    rate: str
    content: str


_ANNOTATIONS = "foxglove.ImageAnnotations"
_IMAGE = "foxglove.CompressedImage"

_SENSOR_CHANNELS = (
    ChannelInfo(READING, SCHEMA_NAME, "60 Hz", "gyro, encoders, and the command of the stack"),
    ChannelInfo(CAMERA_IMAGE, _IMAGE, "10 Hz", "the camera's image, PNG"),
    ChannelInfo(LANDMARK_IMAGE, _IMAGE, "1.25 Hz", "the larger image for landmarks, if any"),
    ChannelInfo(LEFT_IMAGE, _IMAGE, "10 Hz", "left side view, of a wide lens"),
    ChannelInfo(RIGHT_IMAGE, _IMAGE, "10 Hz", "right side view, of a wide lens"),
)
"""What a replay needs, bit for bit."""

VIEWER_CHANNELS = (
    ChannelInfo(FLOW, _ANNOTATIONS, "5 Hz", "derotated flow, lines over the camera's image"),
    ChannelInfo(CELLS, _ANNOTATIONS, "5 Hz", "what each flow cell shows, by colour"),
    ChannelInfo(PERCEPT, "navfw.Percept", "5 Hz", "OFFIS: sentence, quadrants, situations"),
    ChannelInfo(LOCAL_MAP, "foxglove.Grid", "2 Hz", "`occupancy` in percent, in `odom`"),
    ChannelInfo(LOCAL_GOAL, "foxglove.PoseInFrame", "10 Hz", "local goal, in `base_link`"),
    ChannelInfo(OBSTACLES, "foxglove.SceneUpdate", "10 Hz", "moving obstacles, with velocity"),
    ChannelInfo(
        TRANSFORMS,
        "foxglove.FrameTransforms",
        "10 Hz",
        "`map` to `odom` to `base_link` to `camera`",
    ),
    ChannelInfo(POSE, "foxglove.Odometry", "10 Hz", "estimated pose with covariance, twist"),
    ChannelInfo(TRUE_POSE, "foxglove.PoseInFrame", "10 Hz", "true pose"),
    ChannelInfo(PATH, "foxglove.PosesInFrame", "10 Hz", "estimated position and waypoints ahead"),
    ChannelInfo(WORLD, "foxglove.SceneUpdate", "0.2 Hz", "walls and furniture"),
    ChannelInfo(
        PROPOSALS,
        "foxglove.Grid",
        "5 Hz",
        "each behaviour's rating of all commands",
    ),
    ChannelInfo(COMMAND, "navfw.Command", "10 Hz", "the command, its leader, weights and reasons"),
    ChannelInfo(RULES, "navfw.FiredRules", "2 Hz", "rules that fired, as `navfw explain --json`"),
)
"""What people look at."""

CHANNELS = _SENSOR_CHANNELS + VIEWER_CHANNELS
"""All channels of a run."""
