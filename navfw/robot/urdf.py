"""URDF files: the frames of links and joints, and the drive: wheel joints, base_link, the camera.

Only what concerns a robot on wheels is read: PyBullet loads the file itself. A file given as
``pybullet_data:husky/husky.urdf`` is one of those installed with PyBullet.
"""

from __future__ import annotations

import copy
import math
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import Element, tostring

import numpy as np

from navfw.config.document import KeyPath, YamlDocument, key_text
from navfw.config.extras import require_extra
from navfw.config.input_file import is_file, read_input, shown_path
from navfw.config.xml_file import line_of, parse_xml
from navfw.errors import ConfigError, UnknownNameError
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import CameraModel, DrivenUrdf, RobotModel
from navfw.robot.xacro_expansion import expand_xacro

_MAX_BYTES = 5_000_000
"""Largest size of a file [bytes]; that of Husky has 11 kB."""
_BULLET_DATA = "pybullet_data:"
"""Prefix of files that are installed with PyBullet."""
_MAX_MESH = 200_000_000
"""Largest size of a mesh file [bytes]."""
_PACKAGE, _FILE = "package://", "file://"
"""Prefixes of the names of meshes: in a package of ROS, and at an absolute path."""
_MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of joints that a motor moves or holds."""
_KINDS = (*_MOVABLE, "fixed")
ACROSS = 0.99
"""Least share of a wheel's axis that is across the body."""
_STL_HEAD = 84
"""Length of a binary STL file's header [bytes], which ends with the number of triangles."""
_RADIUS_TOLERANCE = 0.02
"""Largest difference between a wheel's radius and its collision shape's, share of the radius."""


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

    ``root`` is its XML, ``packages`` the folders in which packages of ROS were looked for.
    ``inertials`` are the masses [kg] and <inertial> elements of links with a mass, ``massless`` the
    others; ``wheel_radii`` [m] are the radii of the links that collide as one cylinder or sphere.
    """

    file: Path
    root: Element
    packages: tuple[str, ...]
    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]
    collisions: tuple[UrdfCollision, ...]
    inertials: dict[str, tuple[float, Element]]
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


def read_urdf(path: Path, packages: tuple[str, ...] = ()) -> UrdfModel:
    """The links and joints of a URDF file, or of a xacro file; one with the same text is kept.

    ``packages`` are folders with packages of ROS, besides those of the environment's
    ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and those that the file lies in.

    Raises:
        ConfigError: the file cannot be read, is no URDF, has an invalid number, a joint between
            links that it does not have, or names a mesh that does not exist or is empty.
        MissingExtraError: it is a xacro file, and the extra xacro is not installed.

    """
    if path.suffix == ".xacro":
        text = expand_xacro(path, tuple(map(str, _package_roots(path, packages))), _MAX_BYTES)
    else:
        text = read_input(path, _MAX_BYTES)
    model = _parsed(path, packages, text)
    _check_meshes(model)
    return model


@lru_cache(maxsize=16)
def _parsed(path: Path, packages: tuple[str, ...], text: bytes) -> UrdfModel:
    root = parse_xml(text, shown_path(path), "a URDF robot")
    if root.tag != "robot":
        raise ConfigError(
            f"expected a URDF <robot>, got <{root.tag}>; a xacro file ends in .xacro",
            file=shown_path(path),
            line=line_of(root),
        )
    elements = root.findall("link")
    links = tuple(link.get("name", "") for link in elements)
    joints = {}
    for element in root.findall("joint"):
        joint = _joint(path, element, links)
        joints[joint.name] = joint
    inertials = _inertials(path, elements)
    massless = frozenset(links) - frozenset(inertials)
    collisions = tuple(
        UrdfCollision(link.get("name", ""), shape, collision.find("origin"))
        for link in elements
        for collision in link.findall("collision")
        for shape in collision.findall("geometry/*")
    )
    radii = _wheel_radii(path, collisions)
    return UrdfModel(path, root, packages, links, joints, collisions, inertials, massless, radii)


def _inertials(path: Path, links: list[Element]) -> dict[str, tuple[float, Element]]:
    """The mass [kg] and the <inertial> of each link that has a mass."""
    inertials = {link.get("name", ""): link.find("inertial") for link in links}
    masses = {
        name: (attribute_numbers(path, mass, "value", [0.0])[0], inertial)
        for name, inertial in inertials.items()
        if inertial is not None and (mass := inertial.find("mass")) is not None
    }
    return {name: pair for name, pair in masses.items() if pair[0] > 0.0}


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


def _package_roots(path: Path, packages: tuple[str, ...]) -> Iterator[Path]:
    """The folders that have packages of ROS as folders in them."""
    yield from map(Path, packages)
    yield from map(Path, filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)))
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    yield from (Path(prefix) / "share" for prefix in prefixes)
    yield from path.absolute().parents


def _mesh_path(model: UrdfModel, name: str) -> Path | None:
    """The file of the mesh called ``name``; None if it is in a package that is not there."""
    if not name.startswith(_PACKAGE):
        return model.file.parent / name.removeprefix(_FILE)
    package = Path(name.removeprefix(_PACKAGE))
    for root in _package_roots(model.file, model.packages):
        for folder in (root, *((root.parent,) if root.name == package.parts[0] else ())):
            if is_file(folder / package):
                return Path(folder / package)
    return None


def _check_meshes(model: UrdfModel) -> None:
    """Check that the files of all meshes that collide exist; PyBullet would drop the shape.

    Those that are only seen may be missing: no camera sees its own robot. None may be empty.
    """
    colliding = set(model.root.iterfind("link/collision/geometry/mesh"))
    for mesh in model.root.iter("mesh"):
        name = mesh.get("filename", "")
        file = _mesh_path(model, name)
        if file is not None and is_file(file):
            if _is_empty(file):
                raise urdf_error(
                    model.file, mesh, f"mesh {name!r}: {shown_path(file)} is empty: no triangle"
                )
        elif mesh in colliding:
            advice = "copy it beside this file"
            if name.startswith(_PACKAGE):
                advice = "name the folder with its package in urdf.packages or ROS_PACKAGE_PATH"
            raise urdf_error(model.file, mesh, f"mesh {name!r} does not exist; {advice}")


def _is_empty(file: Path) -> bool:
    """Whether a mesh file has no byte or, of a kind in which they are easily found, no triangle."""
    content = read_input(file, _MAX_MESH)
    kind = file.suffix.lower()
    if kind == ".stl" and len(content) >= _STL_HEAD:
        count = int.from_bytes(content[_STL_HEAD - 4 : _STL_HEAD], "little")
        return count == 0 or (content.startswith(b"solid") and b"facet" not in content)
    if kind == ".obj":
        return not any(line.startswith(b"f ") for line in content.splitlines())
    return not content.strip() or (kind == ".stl" and b"facet" not in content)


def loadable_urdf(model: UrdfModel, folder: Path) -> Path:
    """A copy in ``folder`` for PyBullet, or the file itself if that is what PyBullet would read.

    The copy names its meshes by absolute paths, and has no visuals if a mesh of them is missing.
    """
    meshes = {mesh.get("filename", "") for mesh in model.root.iter("mesh")}
    files = {name: _mesh_path(model, name) for name in meshes}
    there = all(file is not None and is_file(file) for file in files.values())
    plain = not any("://" in name for name in meshes) and model.file.suffix != ".xacro"
    if there and plain:
        return model.file
    root = copy.deepcopy(model.root)
    for mesh in root.iter("mesh"):
        mesh.set("filename", str(files[mesh.get("filename", "")]))
    for link in () if there else root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    written = folder / "robot.urdf"
    written.write_bytes(tostring(root))
    return written


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
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != len(default) or not all(math.isfinite(value) for value in values):
        expected = f"{len(default)} finite number{'s' if len(default) > 1 else ''}"
        raise urdf_error(path, element, f"{key}: expected {expected}, got {text!r}")
    return values


def urdf_error(path: Path, element: Element, message: str) -> ConfigError:
    """An error at the line of an element."""
    return ConfigError(message, file=shown_path(path), line=line_of(element))


# --- the drive ------------------------------------------------------------------------------


@dataclass(frozen=True)
class UrdfDrive:
    """How a URDF is driven: the names of its wheel joints, left and right, each with its sense.

    A ``sense`` is -1 where a positive speed drives backward. ``origin`` (3,) [m] is base_link in
    the root link's axes, on the floor where the body turns; ``supports`` (n, 2) [m] are the
    wheels' contact points in base_link. ``held`` joints stay at 0.
    """

    left: tuple[str, ...]
    right: tuple[str, ...]
    sense: dict[str, float]
    origin: Array
    supports: Array
    held: tuple[str, ...]
    model: UrdfModel


def with_urdf(robot: RobotModel, document: YamlDocument, at: KeyPath = ()) -> RobotModel:
    """``robot``, of the document's part ``at``, checked against its URDF, with the camera mounted.

    Raises:
        ConfigError: the URDF cannot be used; a joint is no wheel, or the robot lacks a footprint.
        UnknownNameError: the URDF has no joint or link of a name; the message has the nearest.

    """
    urdf = robot.urdf
    if urdf is None:
        return robot
    if robot.footprint is None:
        with _place(document, at, "urdf"):
            raise ConfigError(
                "a body with a URDF whose collision shapes are meshes, or none, needs a footprint:"
                " {front, rear, width} [m]"
            )
    with _place(document, at, "urdf", "file"):
        model = read_urdf(Path(urdf.file), urdf.packages)
    _check_wheels(urdf, robot.wheel_radius, model, document, at)
    for index, name in enumerate(urdf.casters):
        if name not in model.joints:
            with _place(document, at, "urdf", "casters", index):
                raise UnknownNameError("joint of the URDF", name, model.joints)
    if urdf.camera is None:
        return robot
    if urdf.camera not in model.links:
        with _place(document, at, "urdf", "camera"):
            raise UnknownNameError("link of the URDF", urdf.camera, model.links)
    origin = urdf_drive(robot, model).origin
    return robot.model_copy(update={"camera": _mounted(robot.camera, model, urdf.camera, origin)})


def urdf_drive(robot: RobotModel, model: UrdfModel | None = None) -> UrdfDrive:
    """The drive of a checked robot with a URDF; ``model`` is that file if already read."""
    urdf = robot.urdf
    if urdf is None:
        raise ValueError("the robot has no URDF")
    model = read_urdf(Path(urdf.file), urdf.packages) if model is None else model
    wheels = (*urdf.left, *urdf.right)
    frames = [model.frame_of(model.joints[name].child) for name in wheels]
    centres = np.array([frame[:3, 3] for frame in frames])
    floor = float(centres[:, 2].min()) - robot.wheel_radius
    middle = centres[:, :2].mean(axis=0)
    origin = np.array([middle[0] + urdf.turning_point, middle[1], floor])
    kept = {*wheels, *urdf.casters}
    return UrdfDrive(
        left=urdf.left,
        right=urdf.right,
        sense={name: math.copysign(1.0, axis_across(model, name)) for name in wheels},
        origin=origin,
        supports=centres[:, :2] - origin[:2],
        held=tuple(j.name for j in model.joints.values() if j.movable and j.name not in kept),
        model=model,
    )


def _place(document: YamlDocument, at: KeyPath, *key: str | int) -> AbstractContextManager[None]:
    """Give errors in the block the place of this key of the robot."""
    return document.locating((*at, *key), key=key_text(key))


def _check_wheels(
    urdf: DrivenUrdf, wheel_radius: float, model: UrdfModel, document: YamlDocument, at: KeyPath
) -> None:
    """Check that the named joints are wheels of this radius, each once."""
    seen: set[str] = set()
    turning = {name: joint for name, joint in model.joints.items() if joint.movable}
    for side in ("left", "right"):
        for index, name in enumerate(getattr(urdf, side)):
            with _place(document, at, "urdf", side, index):
                if name not in turning:
                    raise UnknownNameError("movable joint of the URDF", name, turning)
                if name in seen:
                    raise ConfigError(f"the joint {name!r} is named twice: name each wheel once")
                seen.add(name)
                if abs(axis_across(model, name)) < ACROSS:
                    what = f"the axis of {name!r} is not across the body: name a wheel's joint"
                    raise ConfigError(what)
            radius = model.wheel_radii.get(model.joints[name].child)
            if radius and abs(radius / wheel_radius - 1.0) > _RADIUS_TOLERANCE:
                what = f"{wheel_radius:g} m, but the wheel of {name!r} has a radius of"
                with _place(document, at, "wheel_radius"):
                    raise ConfigError(f"{what} {radius:g} m: give that")


def axis_across(model: UrdfModel, joint: str) -> float:
    """The share of a joint's axis that points left, -1 to 1."""
    wheel = model.joints[joint]
    axis = product(model.frame_of(wheel.child)[:3, :3], wheel.axis)
    return float(axis[1] / max(math.hypot(*axis), 1e-9))


def _mounted(camera: CameraModel, model: UrdfModel, link: str, origin: Array) -> CameraModel:
    """``camera`` at ``link``; what the robot's file says of mount and pitch takes precedence."""
    frame = model.frame_of(link)
    ahead = frame[:3, 0]
    mount = {
        "mount_forward": float(frame[0, 3] - origin[0]),
        "mount_height": float(frame[2, 3] - origin[2]),
        "pitch": math.asin(min(max(float(-ahead[2]), -1.0), 1.0)),
    }
    from_file = {name: getattr(camera, name) for name in camera.model_fields_set}
    return camera.model_copy(update=mount | from_file)
