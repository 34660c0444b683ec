"""Convert poses of SDF, in worlds and in the <gazebo> elements of URDFs."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.foreign_files import element_error, numbers_in
from navfw.numerics import Array
from navfw.robot.urdf_model import quaternion_matrix, rigid_transform

_MAX = 1e6  # chosen
"""Bound of coordinates [m] and angles [rad or degrees]."""


def sdf_pose(pose: Element) -> Array:
    """Convert a <pose> into a transform (4, 4); the identity if it is empty.

    Its angles are in radians, or with ``degrees`` in degrees; with the ``rotation_format``
    ``quat_xyzw`` it has a quaternion instead.

    Raises:
        ConfigError: it has other than 6 or 7 numbers, or an unknown format.

    """
    form = pose.get("rotation_format", "euler_rpy")
    in_degrees = pose.get("degrees", "false").strip() in {"true", "1"}
    none = {"euler_rpy": [0.0] * 6, "quat_xyzw": [0.0] * 6 + [1.0]}.get(form, [])
    numbers = sdf_numbers(pose, len(none), none, "pose") if none else []
    at, turns, wrong = numbers[:3], numbers[3:], ""
    if not none:
        wrong = f"the rotation_format euler_rpy or quat_xyzw, got {form!r}"
    elif form == "quat_xyzw" and (in_degrees or not any(turns)):
        wrong = "no degrees with a quaternion" if in_degrees else "a quaternion other than 0"
    if wrong:
        raise element_error(pose, f"expected {wrong}", "pose")
    if form == "euler_rpy":
        return rigid_transform(*at, *(map(math.radians, turns) if in_degrees else turns))
    frame = np.eye(4)
    frame[:3, :3] = quaternion_matrix(*np.array(turns) / math.hypot(*turns))
    frame[:3, 3] = at
    return frame


def sdf_numbers(element: Element, count: int, missing: list[float], key: str) -> list[float]:
    """Read the ``count`` numbers in an element, which are called ``key`` in errors.

    An empty element has those of ``missing``, if there are any. Raises as ``numbers_in``.
    """
    text = element.text or ""
    return numbers_in(element, text, count, key, _MAX) if text.strip() or not missing else missing
