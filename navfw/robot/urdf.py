"""URDF files: the frames of links and joints, and what a drive by them needs.

Only what concerns a robot on wheels is read: PyBullet loads the file itself. A file given as
``pybullet_data:husky/husky.urdf`` is one of those installed with PyBullet.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from navfw.config.extras import require_extra
from navfw.config.input_file import is_file, shown_path
from navfw.config.xml_file import line_of, read_xml
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product

_MAX_BYTES = 5_000_000
"""Largest size of a file [bytes]; that of Husky has 11 kB."""
_BULLET_DATA = "pybullet_data:"
"""Prefix of files that are installed with PyBullet."""
_MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of joints that a motor moves or holds."""
_KINDS = (*_MOVABLE, "fixed")


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: its type, the links it joins, its ``frame`` (4, 4) in the parent, and its axis.

    ``axis`` (3,) is in the joint's frame, ``line`` the joint's in the file.
    """

    name: str
    kind: str
    parent: str
    child: str
    frame: Array
    axis: Array
    line: int

    @property
    def movable(self) -> bool:
        """Whether it is not fixed."""
        return self.kind in _MOVABLE


@dataclass(frozen=True)
class UrdfCollision:
    """A collision shape of a link: the element in its <geometry>, and its <origin>, if any."""

    link: str
    shape: Element
    origin: Element | None


@dataclass(frozen=True)
class UrdfModel:
    """A URDF file: its joints by name, links and collision shapes.

    ``massless`` are the links without inertia; ``wheel_radii`` [m] are the radii of the links that
    collide as one cylinder or sphere.
    """

    file: Path
    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]
    collisions: tuple[UrdfCollision, ...]
    massless: frozenset[str]
    wheel_radii: dict[str, float]

    def frame_of(self, link: str) -> Array:
        """Transform (4, 4) from ``link`` to the root link, all joints at zero."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        frame: Array = np.eye(4)
        for _ in self.links:
            joint = by_child.get(link)
            if joint is None:
                break
            frame, link = product(joint.frame, frame), joint.parent
        return frame


def urdf_path(name: str, folder: Path) -> Path:
    """The file of that name: relative to ``folder``, or with the prefix ``pybullet_data:``.

    Raises:
        MissingExtraError: PyBullet's data are not installed.

    """
    if not name.startswith(_BULLET_DATA):
        return folder / name
    require_extra("sim", "pybullet_data", key=name)
    return Path(str(files("pybullet_data"))) / name.removeprefix(_BULLET_DATA)


def read_urdf(path: Path) -> UrdfModel:
    """The links and joints of a URDF file.

    Raises:
        ConfigError: the file cannot be read, is no URDF, has an invalid number, a joint between
            links that it does not have, or names a mesh that does not exist.

    """
    root = read_xml(path, _MAX_BYTES, "a URDF robot")
    if root.tag != "robot":
        raise ConfigError(
            f"expected a URDF <robot>, got <{root.tag}>; convert xacro files with the tool xacro",
            file=shown_path(path),
            line=line_of(root),
        )
    elements = root.findall("link")
    links = tuple(link.get("name", "") for link in elements)
    joints = {}
    for element in root.findall("joint"):
        joint = _joint(path, element, links)
        joints[joint.name] = joint
    _check_meshes(path, root)
    massless = frozenset(link.get("name", "") for link in elements if link.find("inertial") is None)
    collisions = tuple(
        UrdfCollision(link.get("name", ""), shape, collision.find("origin"))
        for link in elements
        for collision in link.findall("collision")
        for shape in collision.findall("geometry/*")
    )
    return UrdfModel(path, links, joints, collisions, massless, _wheel_radii(path, collisions))


def _joint(path: Path, element: Element, links: tuple[str, ...]) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in _KINDS:
        raise urdf_error(
            path, element, f"joint {name!r}: expected a type of {_KINDS}, got {kind!r}"
        )
    ends: dict[str, str] = {}
    for end in ("parent", "child"):
        named = element.find(end)
        link = ends[end] = "" if named is None else named.get("link", "")
        if link not in links:
            raise urdf_error(
                path, element, f"joint {name!r}: its {end} link {link!r} does not exist"
            )
    axis_element = element.find("axis")
    axis = [1.0, 0.0, 0.0]
    if axis_element is not None:
        axis = attribute_numbers(path, axis_element, "xyz", axis)
    frame = origin_frame(path, element.find("origin"))
    return UrdfJoint(
        name, kind, ends["parent"], ends["child"], frame, np.array(axis), line_of(element)
    )


def _check_meshes(path: Path, root: Element) -> None:
    """Check that the files of all meshes exist; PyBullet would drop a shape without a word."""
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" in name:
            raise urdf_error(
                path, mesh, f"mesh {name!r}: expected a path relative to this file; replace the URI"
            )
        if not is_file(path.parent / name):
            raise urdf_error(path, mesh, f"mesh {name!r} does not exist; copy it beside this file")


def _wheel_radii(path: Path, collisions: tuple[UrdfCollision, ...]) -> dict[str, float]:
    """Radii [m] of the links that collide as one cylinder or sphere."""
    counts = Counter(collision.link for collision in collisions)
    return {
        collision.link: attribute_numbers(path, collision.shape, "radius", [0.0])[0]
        for collision in collisions
        if counts[collision.link] == 1 and collision.shape.tag in {"cylinder", "sphere"}
    }


def origin_frame(path: Path, origin: Element | None) -> Array:
    """Transform (4, 4) of an <origin>; without one, none."""
    if origin is None:
        return np.eye(4)
    x, y, z = attribute_numbers(path, origin, "xyz", [0.0, 0.0, 0.0])
    return rigid_transform(x, y, z, *attribute_numbers(path, origin, "rpy", [0.0, 0.0, 0.0]))


def rigid_transform(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> Array:
    """Transform (4, 4) of a shift [m] and turns [rad] about fixed axes, roll first."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
            [-sp, cp * sr, cp * cr, z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def attribute_numbers(path: Path, element: Element, key: str, default: list[float]) -> list[float]:
    """The numbers of an attribute, as many as those of ``default``, which holds without it.

    Raises:
        ConfigError: they are not finite numbers, or too few or too many.

    """
    text = element.get(key)
    if text is None or "$(" in text:  # a leftover of xacro, which PyBullet reads as 0
        return default
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != len(default) or not all(math.isfinite(value) for value in values):
        expected = f"{len(default)} finite number{'s' if len(default) > 1 else ''}"
        raise urdf_error(path, element, f"{key}: expected {expected}, got {text!r}")
    return values


def urdf_error(path: Path, element: Element, message: str) -> ConfigError:
    """An error at the line of an element."""
    return ConfigError(message, file=shown_path(path), line=line_of(element))
