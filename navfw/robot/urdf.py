"""URDF files: the frames of links and joints, collision shapes, masses, meshes.

Only what concerns a robot on wheels is read: PyBullet loads the file itself. A file given as
``pybullet_data:husky/husky.urdf`` is one of those installed with PyBullet.
"""

from __future__ import annotations

import copy
import math
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import Element, tostring

import numpy as np

from navfw.config.extras import require_extra
from navfw.config.foreign_files import line_of, parse_xml
from navfw.config.input_file import is_file, read_input, shown_path
from navfw.config.lookup import package_folders, package_roots
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product

_BULLET_DATA = "pybullet_data:"
"""Prefix of files that are installed with PyBullet."""
_PACKAGE, _FILE = "package://", "file://"
"""Prefixes of the names of meshes: in a package of ROS, and at an absolute path."""
_MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of joints that a motor moves or holds."""
_KINDS = (*_MOVABLE, "fixed")
_ONE_TRIANGLE = 84 + 50  # defined
"""Length of a binary STL file with one triangle [bytes]."""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: its type, the links it joins, its ``frame`` (4, 4) in the parent, and its axis.

    ``axis`` (3,) is in the joint's frame; ``line`` is the number of the joint's line in the file.
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
        """Whether the joint is not fixed."""
        return self.kind in _MOVABLE


@dataclass(frozen=True)
class UrdfCollision:
    """A collision shape of a link: the element in its <geometry>, at ``frame`` (4, 4) in the link.

    ``size`` (3,) [m] is that of a box, cylinder or sphere along its own axes, None for a mesh;
    ``radius`` [m] is that of a cylinder or sphere, otherwise 0.
    """

    link: str
    shape: Element
    frame: Array
    size: Array | None
    radius: float


@dataclass(frozen=True)
class UrdfModel:
    """A URDF file: its joints by name, links and collision shapes.

    ``root`` is its XML, ``packages`` the folders to search for packages of ROS. ``inertials`` are
    the masses [kg] and <inertial> elements of links with a mass, ``massless`` the other links;
    ``wheel_radii`` [m] are the radii of links whose collision shape is one cylinder or sphere.
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

    def above(self, link: str) -> list[UrdfJoint]:
        """The joints from ``link`` up to the root link."""
        by_child = {joint.child: joint for joint in self.joints.values()}
        chain: list[UrdfJoint] = []
        while link in by_child and len(chain) < len(self.links):
            chain.append(by_child[link])
            link = chain[-1].parent
        return chain

    def frame_of(self, link: str) -> Array:
        """Compute the transform (4, 4) from ``link`` to the root link, with all joints at zero."""
        frame: Array = np.eye(4)
        for joint in self.above(link):
            frame = product(joint.frame, frame)
        return frame


def urdf_path(name: str, folder: Path) -> Path:
    """Return the file of that name: relative to ``folder``, or with prefix ``pybullet_data:``.

    Raises:
        MissingExtraError: PyBullet's data are not installed.

    """
    if not name.startswith(_BULLET_DATA):
        return folder / name
    require_extra("sim", "pybullet_data", key=name)
    return Path(str(files("pybullet_data"))) / name.removeprefix(_BULLET_DATA)


def read_urdf(path: Path, packages: tuple[str, ...] = ()) -> UrdfModel:
    """Read a URDF file or a xacro file; it is parsed again only if its text has changed.

    ``packages`` are folders with packages of ROS, besides those of the environment's
    ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and those that the file lies in.

    Raises:
        ConfigError: the file cannot be read, is no URDF, has an invalid number, a joint between
            links that it does not have, or names a mesh that does not exist or is empty.
        MissingExtraError: it is a xacro file, and the extra xacro is not installed.

    """
    if path.suffix == ".xacro":
        from navfw.robot.xacro_expansion import expand_xacro

        text = expand_xacro(path, tuple(map(str, package_roots(path, packages))))
    else:
        text = read_input(path)
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
        _collision(path, link.get("name", ""), shape, collision.find("origin"))
        for link in elements
        for collision in link.findall("collision")
        for shape in collision.findall("geometry/*")
    )
    counts = Counter(collision.link for collision in collisions)
    radii = {c.link: c.radius for c in collisions if counts[c.link] == 1 and c.radius}
    return UrdfModel(path, root, packages, links, joints, collisions, inertials, massless, radii)


def _collision(path: Path, link: str, shape: Element, origin: Element | None) -> UrdfCollision:
    size, radius = None, 0.0
    if shape.tag in {"box", "cylinder", "sphere"}:
        radius = attribute_numbers(path, shape, "radius", [0.0])[0]
        length = attribute_numbers(path, shape, "length", [2.0 * radius])[0]
        round_ = [2.0 * radius, 2.0 * radius, length]
        size = np.array(attribute_numbers(path, shape, "size", round_))
    return UrdfCollision(link, shape, origin_frame(path, origin), size, radius)


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


def _mesh_path(model: UrdfModel, name: str) -> Path | None:
    """The file of the mesh called ``name``; None if it is in a package that is not there."""
    if not name.startswith(_PACKAGE):
        return model.file.parent / name.removeprefix(_FILE)
    package, _, rest = name.removeprefix(_PACKAGE).partition("/")
    folders = package_folders(package, package_roots(model.file, model.packages))
    return next((folder / rest for folder in folders if is_file(folder / rest)), None)


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
    """Whether a mesh file has no triangle, where that is easily found, or no byte."""
    content = read_input(file)
    if file.suffix.lower() == ".stl":
        return b"facet" not in content and len(content) < _ONE_TRIANGLE
    if file.suffix.lower() == ".obj":
        return not any(line.split(maxsplit=1)[:1] == [b"f"] for line in content.splitlines())
    return not content.strip()


def loadable_urdf(model: UrdfModel, folder: Path) -> Path:
    """Return a file that PyBullet can load: the model's own if it can, else a copy in ``folder``.

    The copy names its meshes by absolute paths, and has no visuals if any mesh file is missing.
    """
    meshes = {mesh.get("filename", "") for mesh in model.root.iter("mesh")}
    files = {name: _mesh_path(model, name) for name in meshes}
    complete = all(file is not None and is_file(file) for file in files.values())
    plain = not any("://" in name for name in meshes) and model.file.suffix != ".xacro"
    if complete and plain:
        return model.file
    root = copy.deepcopy(model.root)
    for mesh in root.iter("mesh"):
        mesh.set("filename", str(files[mesh.get("filename", "")]))
    for link in () if complete else root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    written = folder / "robot.urdf"
    written.write_bytes(tostring(root))
    return written


def origin_frame(path: Path, origin: Element | None) -> Array:
    """Convert an <origin> into a transform (4, 4); the identity if it is None."""
    if origin is None:
        return np.eye(4)
    x, y, z = attribute_numbers(path, origin, "xyz", [0.0, 0.0, 0.0])
    return rigid_transform(x, y, z, *attribute_numbers(path, origin, "rpy", [0.0, 0.0, 0.0]))


def rigid_transform(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> Array:
    """Make the transform (4, 4) of a shift [m] and turns [rad] about fixed axes, roll first."""
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
    """Read the numbers of an attribute, as many as ``default`` has; ``default`` if it is missing.

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
    """Make an error at the line of an element in the file at ``path``."""
    return ConfigError(message, file=shown_path(path), line=line_of(element))
