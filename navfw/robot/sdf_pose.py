"""Poses of SDF, in worlds and in the <gazebo> elements of URDFs."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.foreign_files import line_of
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.robot.urdf_model import quaternion_matrix, rigid_transform

_MAX = 1e6  # chosen
"""Bound of coordinates [m] and angles."""


def sdf_pose(pose: Element, file: str) -> Array:
    """Convert a <pose> in ``file`` into a transform (4, 4); the identity if it is empty.

    Its angles are in radians, or with ``degrees`` in degrees; with the ``rotation_format``
    ``quat_xyzw`` it has a quaternion instead.

    Raises:
        ConfigError: it has other than 6 or 7 numbers, or an unknown format.

    """
    form = pose.get("rotation_format", "euler_rpy")
    in_degrees = pose.get("degrees", "false").strip() in {"true", "1"}
    count = {"euler_rpy": 6, "quat_xyzw": 7}.get(form)
    text = (pose.text or "").split()
    try:
        numbers = [float(word) for word in text]
    except ValueError:
        numbers = []
    expected = ""
    if count is None:
        expected = f"the rotation_format euler_rpy or quat_xyzw, got {form!r}"
    elif count == 7 and in_degrees:
        expected = "no degrees with the rotation_format quat_xyzw"
    elif text and (len(numbers) != count or not all(abs(number) < _MAX for number in numbers)):
        expected = f"{count} numbers, got {' '.join(text)!r}"
    elif count == 7 and text and math.hypot(*numbers[3:]) < 1e-6:
        expected = "a quaternion other than 0"
    if expected:
        raise ConfigError(f"expected {expected}", file=file, line=line_of(pose), key="pose")
    if not text:
        return np.eye(4)
    if count == 6:
        turns = numbers[3:]
        return rigid_transform(*numbers[:3], *(map(math.radians, turns) if in_degrees else turns))
    frame = np.eye(4)
    frame[:3, :3] = quaternion_matrix(*np.array(numbers[3:]) / math.hypot(*numbers[3:]))
    frame[:3, 3] = numbers[:3]
    return frame
