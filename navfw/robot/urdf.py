"""Read URDF files, and check them before PyBullet loads them, which a broken tree would crash.

Only the elements that a robot on wheels needs are read. A file given as
``pybullet_data:husky/husky.urdf`` is one of those installed with PyBullet.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from navfw.config.extras import require_extra
from navfw.config.foreign_files import element_error, parse_xml
from navfw.config.input_file import read_input, shown_path
from navfw.config.lookup import package_roots
from navfw.errors import ConfigError, did_you_mean
from navfw.robot.urdf_model import (
    KINDS,
    MOMENTS,
    SHAPES,
    UrdfCollision,
    UrdfJoint,
    UrdfModel,
    attribute_numbers,
    is_shaped,
    origin_frame,
)

_BULLET_DATA = "pybullet_data:"
"""Prefix of files that are installed with PyBullet."""
_MAX_NAME = 200  # chosen
"""Longest name of a link or joint: PyBullet has room for 1024 bytes."""
_TURN = 2.0 * math.pi  # defined
"""Range [rad] within which a joint counts as limited; a wheel has no limit."""


def urdf_path(name: str, folder: Path) -> Path:
    """Return the file of that name: relative to ``folder``, or with prefix ``pybullet_data:``.

    Raises:
        MissingExtraError: PyBullet's data are not installed.

    """
    if not name.startswith(_BULLET_DATA):
        return folder / name
    require_extra("sim", "pybullet_data", key=name)
    return Path(str(files("pybullet_data"))) / name.removeprefix(_BULLET_DATA)


def read_urdf(path: Path, packages: tuple[str, ...] = (), args: tuple[str, ...] = ()) -> UrdfModel:
    """Read a URDF file or a xacro file; it is parsed again only if its text has changed.

    ``packages`` are folders with packages of ROS, besides those of the environment's
    ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and those that the file lies in. ``args`` are
    arguments of a xacro file, such as ``use_camera:=true``.

    Raises:
        ConfigError: the file cannot be read, is no URDF, has an invalid number, or links that form
            no tree.
        MissingExtraError: it is a xacro file, and the extra xacro is not installed.

    """
    if path.suffix == ".xacro":
        from navfw.robot.xacro_expansion import expand_xacro

        text = expand_xacro(path, tuple(map(str, package_roots(path, packages))), args)
    elif args:
        what = f"is no xacro file: it has no argument {args[0]!r}"
        raise ConfigError(what, file=shown_path(path))
    else:
        text = read_input(path)
    return _parsed(path, packages, text)


@lru_cache(maxsize=16)
def _parsed(path: Path, packages: tuple[str, ...], text: bytes) -> UrdfModel:
    root = parse_xml(text, shown_path(path), "a URDF robot")
    if root.tag != "robot":
        raise element_error(root, f"expected a URDF <robot>, got <{root.tag}>")
    links = _named(root, "link")
    if not links:
        what = "; name the file that calls its macros" if path.suffix == ".xacro" else ""
        raise element_error(root, f"the robot has no <link>{what}")
    elements = _named(root, "joint")
    unlimited = tuple(name for name, element in elements.items() if _unlimited(element))
    joints = {name: _joint(element, links) for name, element in elements.items()}
    _check_tree(links, joints, elements)
    inertials = _inertials(links)
    seen = tuple(_let_visuals_collide(links, joints))
    collisions = tuple(
        _collision(name, collision)
        for name, link in links.items()
        for collision in link.findall("collision")
    )
    return UrdfModel(
        path, root, packages, tuple(links), joints, collisions, inertials, unlimited, seen
    )


def _named(root: Element, tag: str) -> dict[str, Element]:
    """Return the elements of that tag by their names, which must differ."""
    named: dict[str, Element] = {}
    for element in root.findall(tag):
        name = element.get("name", "")
        if not 0 < len(name) <= _MAX_NAME:
            what = f"a <{tag}> needs a name of 1 to {_MAX_NAME} characters, got {name[:20]!r}"
            raise element_error(element, what)
        first = named.setdefault(name, element)
        if first is not element:
            raise element_error(element, f"a second {tag} {name!r}: rename or remove one")
    return named


def _check_tree(
    links: dict[str, Element], joints: dict[str, UrdfJoint], at: dict[str, Element]
) -> None:
    """Check that the joints, whose elements are ``at``, connect all links to one tree."""
    above: dict[str, str] = {}
    for name, joint in joints.items():
        if (first := above.setdefault(joint.child, name)) != name:
            what = f"its child link {joint.child!r} hangs on joint {first!r}; remove one"
            raise element_error(at[name], f"joint {name!r}: {what}")
    roots: list[str] = []
    for link in links:
        chain = [link]
        while chain[-1] in above and (parent := joints[above[chain[-1]]].parent) not in chain:
            chain.append(parent)
        if chain[-1] in above:
            loop = chain[chain.index(parent) :]
            last = max((above[member] for member in loop), key=list(joints).index)
            what = f"closes a loop of the links {', '.join(loop)}; remove it, or another of them"
            raise element_error(at[last], f"joint {last!r} {what}")
        roots.append(chain[-1])
    root, *others = (name for name, _ in Counter(roots).most_common())
    for other in others:
        what = f"link {other!r} is attached by no joint, and {root!r} is the root: add a joint with"
        raise element_error(links[other], f'{what} <child link="{other}"/>, or remove the link')
    if root == "world":
        what = "link 'world' holds the robot in place: remove it, and the joint that hangs on it"
        raise element_error(links[root], what)


def _unlimited(joint: Element) -> bool:
    """Make a revolute joint continuous if it may turn more than once; return whether it may."""
    if joint.get("type") != "revolute":
        return False
    limit = joint.find("limit")
    if limit is not None and {"lower", "upper"} & set(limit.keys()):
        low, high = (attribute_numbers(limit, key, [0.0])[0] for key in ("lower", "upper"))
        if high - low <= _TURN:
            return False
    joint.set("type", "continuous")
    return True


def _let_visuals_collide(links: dict[str, Element], joints: dict[str, UrdfJoint]) -> Iterator[str]:
    """Give the body, and each wheel, that has no collision shape its visuals as such.

    A wheel is a part that turns without end and carries nothing. Yields the links that get shapes.
    """
    moved = {joint.child: joint for joint in joints.values() if joint.movable}
    carriers = {joint.parent for joint in moved.values()}
    above = {joint.child: joint.parent for joint in joints.values() if not joint.movable}
    bodies: dict[str, list[str]] = {}
    for link in links:
        head = link
        while head in above:
            head = above[head]
        bodies.setdefault(head, []).append(link)
    for head, body in bodies.items():
        turns = head in moved and moved[head].kind == "continuous"
        if head in moved and not (turns and carriers.isdisjoint(body)):
            continue
        members = [links[name] for name in body]
        if any(member.find("collision") is not None for member in members):
            continue
        for member in members:
            for visual in member.findall("visual"):
                collision = SubElement(member, "collision", visual.attrib)
                collision.extend(part for part in visual if part.tag in {"origin", "geometry"})
                yield member.get("name", "")


def _collision(link: str, element: Element) -> UrdfCollision:
    shapes = element.findall("geometry/*")
    if not is_shaped(element):
        known = ", ".join(f"<{tag} {'= '.join(keys)}=>" for tag, keys in SHAPES.items())
        got = "".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
        what = f"link {link!r}: its <{element.tag}> needs one shape in <geometry>, got {got}"
        raise element_error(element, f"{what}; known: {known}")
    shape, size, radius = shapes[0], None, 0.0
    if shape.tag != "mesh":
        radius = attribute_numbers(shape, "radius", [0.0])[0]
        length = attribute_numbers(shape, "length", [0.0])[0]
        if shape.tag in {"sphere", "capsule"}:
            length += 2.0 * radius
        round_ = [2.0 * radius, 2.0 * radius, length]
        size = np.array(attribute_numbers(shape, "size", round_))
        if size.min() < 0.0:
            raise element_error(shape, f"link {link!r}: expected sizes of at least 0 m")
    return UrdfCollision(link, shape, origin_frame(element.find("origin")), size, radius)


def _inertials(links: dict[str, Element]) -> dict[str, tuple[float, Element]]:
    """Return mass [kg] and <inertial> of each link that has a mass; remove those of others.

    Missing moments become 0.
    """
    inertials = {}
    for name, link in links.items():
        for inertial in link.findall("inertial")[:1]:
            element = inertial.find("mass")
            mass = 0.0 if element is None else attribute_numbers(element, "value", [0.0])[0]
            if mass < 0.0:
                what = f"link {name!r}: expected a mass above 0 kg, got {mass:g}"
                raise element_error(inertial, what)
            if mass == 0.0:
                link.remove(inertial)
                continue
            if inertial.find("inertia") is None:
                SubElement(inertial, "inertia", inertial.attrib)
            for inertia in inertial.findall("inertia"):
                inertia.attrib = {**dict.fromkeys(MOMENTS, "0"), **inertia.attrib}
            inertials[name] = mass, inertial
    return inertials


def _joint(element: Element, links: dict[str, Element]) -> UrdfJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in KINDS:
        raise element_error(element, f"joint {name!r}: expected a type of {KINDS}, got {kind!r}")
    ends: dict[str, str] = {}
    for end in ("parent", "child"):
        named = element.find(end)
        link = ends[end] = "" if named is None else named.get("link", "")
        if link not in links:
            what = f"joint {name!r}: its {end} link {link!r} does not exist"
            raise element_error(element, f"{what}; {did_you_mean(link, links)}")
    axis = [1.0, 0.0, 0.0]
    for told in element.findall("axis")[:1]:
        axis = attribute_numbers(told, "xyz", axis)
    if kind != "fixed" and not any(axis):
        raise element_error(element, f"joint {name!r}: expected an axis other than 0 0 0")
    return UrdfJoint(
        name, kind, **ends, frame=origin_frame(element.find("origin")), axis=np.array(axis)
    )
