"""What passes between the rooms: small frozen dataclasses, one per arrow of the data flow.

Conventions (all of navfw): SI units and radians. Frames after REP-103/105: ``map``, ``odom`` and
``base_link`` have x forward, y left, z up, yaw counter-clockwise; ``camera_optical`` has z
forward, x right, y down. Image points are in pixels relative to the principal point (x right,
y down). Arrays over the grid have shape (rows, cols) with row 0 at the top of the image and column
0 at its left. Nearness is 1/Z [1/m], Z the depth along the optical axis.
"""

from __future__ import annotations

from navfw.numerics.arrays import Array, Image, Mask
from navfw.signals.commands import (
    Command,
    Explain,
    Proposal,
)
from navfw.signals.flow import (
    CameraMotion,
    FlowField,
    FramePair,
    Odometry,
    YawCorrection,
)
from navfw.signals.geometry import Pose, Twist, position_sigma, wrap_angle
from navfw.signals.percepts import (
    Conflicts,
    Label,
    MovingObject,
    OccupiedDisc,
    Percept,
    Sight,
    Stixels,
)
from navfw.signals.places import (
    Belief,
    LandmarkDetection,
    PassageQuery,
    PassageReport,
    PassageStatus,
    Waypoint,
)
from navfw.signals.sensors import (
    Encoders,
    Frame,
    Inertial,
    SensorReading,
)

__all__ = [
    "Array",
    "Belief",
    "CameraMotion",
    "Command",
    "Conflicts",
    "Encoders",
    "Explain",
    "FlowField",
    "Frame",
    "FramePair",
    "Image",
    "Inertial",
    "Label",
    "LandmarkDetection",
    "Mask",
    "MovingObject",
    "OccupiedDisc",
    "Odometry",
    "PassageQuery",
    "PassageReport",
    "PassageStatus",
    "Percept",
    "Pose",
    "Proposal",
    "SensorReading",
    "Sight",
    "Stixels",
    "Twist",
    "Waypoint",
    "YawCorrection",
    "position_sigma",
    "wrap_angle",
]
