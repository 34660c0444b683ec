"""Hold the data of a URDF file: the frames of links and joints, collision shapes, masses."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.foreign_files import numbers_in
from navfw.numerics import Array
from navfw.numerics.products import product

_MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of joints that a motor moves or holds."""
KINDS = (*_MOVABLE, "fixed")
"""Types of joints that a robot may have."""
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""Attributes of an <inertia>."""

SHAPES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "mesh": ("filename",),
}
"""Shapes of links, and the attributes that they need."""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: type, links, ``frame`` (4, 4) in the parent, ``axis`` (3,) in its own frame."""

    name: str
    kind: str
    parent: str
    child: str
    frame: Array
    axis: Array

    @property
    def movable(self) -> bool:
        """Whether the joint is not fixed."""
        return self.kind in _MOVABLE


@dataclass(frozen=True)
class UrdfCollision:
    """A collision shape of a link: the element in its <geometry>, at ``frame`` (4, 4) in the link.

    ``size`` (3,) [m] is the extent of a box, cylinder, capsule or sphere along its own axes, None
    for a mesh; ``radius`` [m] is that of a round shape, otherwise 0.
    """

    link: str
    shape: Element
    frame: Array
    size: Array | None
    radius: float


@dataclass(frozen=True)
class UrdfModel:
    """The data of a URDF file: its joints by name, links and collision shapes.

    ``root`` is its XML, ``packages`` the folders to search for packages of ROS. ``inertials`` are
    the masses [kg] and <inertial> elements of links with a mass. ``unlimited`` are revolute joints
    that count as continuous, ``seen`` links that collide by their visuals.
    """

    file: Path
    root: Element
    packages: tuple[str, ...]
    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]
    collisions: tuple[UrdfCollision, ...]
    inertials: dict[str, tuple[float, Element]]
    unlimited: tuple[str, ...]
    seen: tuple[str, ...]

    @cached_property
    def wheel_radii(self) -> dict[str, float]:
        """Radii [m], by link, of links with only one collision shape, a cylinder or sphere."""
        counts = Counter(collision.link for collision in self.collisions)
        return {c.link: c.radius for c in self.collisions if counts[c.link] == 1 and c.radius}

    def above(self, link: str) -> list[UrdfJoint]:
        """Return the joints from ``link`` up to the root link."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        chain: list[UrdfJoint] = []
        while link in by_child:
            chain.append(by_child[link])
            link = chain[-1].parent
        return chain

    def frame_of(self, link: str) -> Array:
        """Compute the transform (4, 4) from ``link`` to the root link, with all joints at zero."""
        frame: Array = np.eye(4)
        for joint in self.above(link):
            frame = product(joint.frame, frame)
        return frame


def is_shaped(element: Element) -> bool:
    """Return whether a <collision> or <visual> has exactly one shape of SHAPES."""
    shapes = element.findall("geometry/*")
    return len(shapes) == 1 and set(SHAPES.get(shapes[0].tag, ("",))) <= set(shapes[0].keys())


def origin_frame(origin: Element | None) -> Array:
    """Convert an <origin> into a transform (4, 4); the identity if it is None."""
    if origin is None:
        return np.eye(4)
    x, y, z = attribute_numbers(origin, "xyz", [0.0, 0.0, 0.0])
    return rigid_transform(x, y, z, *attribute_numbers(origin, "rpy", [0.0, 0.0, 0.0]))


def rigid_transform(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> Array:
    """Make the transform (4, 4) of a translation [m] and turns [rad] about fixed axes, x first."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
            [-sp, cp * sr, cp * cr, z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def quaternion_matrix(x: float, y: float, z: float, w: float) -> Array:
    """Make the rotation matrix (3, 3) of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def attribute_numbers(element: Element, key: str, default: list[float]) -> list[float]:
    """Read the numbers of an attribute, as many as ``default`` has; ``default`` if it is missing.

    Raises:
        ConfigError: they are not finite numbers, or too few or too many.

    """
    text = element.get(key)
    if text is None or "$(" in text:  # a leftover of xacro, which PyBullet reads as 0
        return default
    return numbers_in(element, text, len(default), key)
