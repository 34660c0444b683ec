"""What a URDF says of a robot, wheels, track, body and camera, and what its file says otherwise.

A robot file on a URDF has these values beneath its own; ``--robot FILE.urdf`` has them alone.

Of inertia, that which no body of that mass and size can have, and what would do: published files
have 1 kg m^2 on a plate of 10 g, which makes a body that follows no command.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.foreign_files import line_of
from navfw.config.input_file import shown_path
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product, sum_in_order
from navfw.robot import CameraModel, RobotModel
from navfw.robot.urdf import (
    UrdfCollision,
    UrdfJoint,
    UrdfModel,
    attribute_numbers,
    origin_frame,
    read_urdf,
)
from navfw.robot.urdf_drive import ACROSS, axis_across

_DENSITY = 1000.0  # derived
"""Density [kg/m^3] of the cube that stands for a link without a shape: that of water."""

_ROOM, _WIDE_ROOM = 1.5, 3.0  # chosen
"""Factors on the reach of a link's collision shapes, of which more may be seen, and on the size of
the robot for one without a shape or with a mesh."""

_MIN_MOMENT, _NEGLIGIBLE = 1e-3, 1e-3  # chosen
"""Least principal moment as a part of the box's, a rod's about its own axis; and a moment that does
not matter, as a part of the robot's mass times its squared size."""

_ROUNDING = 1.02  # derived
"""Largest principal moment over the sum of the others, which it cannot exceed but by rounding."""

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def impossible_inertias(
    robot: RobotModel, model: UrdfModel
) -> dict[str, tuple[str, tuple[float, ...]]]:
    """Find links whose inertia no body can have; return by link a note and the moments of a box.

    A principal moment is not positive, exceeds the sum of the others, or is too large or too small
    for mass and collision shapes. The box [kg m^2, about x, y, z] has the link's mass and size.

    Raises:
        ConfigError: a moment is no finite number.

    """
    extent = max(2.0 * robot.reach, robot.height)
    total = sum_in_order(mass for mass, _ in model.inertials.values())
    impossible = {}
    for link, (mass, inertial) in model.inertials.items():
        element = inertial.find("inertia")
        if element is None:
            continue
        moments = (attribute_numbers(model.file, element, key, [0.0])[0] for key in _MOMENTS)
        xx, yy, zz, xy, xz, yz = moments
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        low, middle, high = np.linalg.eigvalsh(matrix).tolist()
        size, reach = np.full(3, (mass / _DENSITY) ** (1.0 / 3.0)), _WIDE_ROOM * extent
        shapes = _extent((c, c.frame) for c in model.collisions if c.link == link)
        if shapes is not None:
            centre = origin_frame(model.file, inertial.find("origin"))[:3, 3]
            size = shapes[1] - shapes[0]
            reach = _ROOM * math.hypot(*np.abs(np.array(shapes) - centre).max(axis=0))
        squares = size * size
        box = tuple((mass / 12.0 * (squares.sum() - squares)).tolist())
        closed = low > _MIN_MOMENT * min(box) and high <= _ROUNDING * (low + middle)
        if closed and high <= max(mass * reach**2, _NEGLIGIBLE * total * extent**2):
            continue
        have, would = (", ".join(f"{m:.2g}" for m in ms) for ms in ((low, middle, high), box))
        note = (
            f"{shown_path(model.file)}:{line_of(element)}: link {link!r}: no body of {mass:g} kg"
            f" and its size has the principal moments {have} kg m^2; driven with those of a box,"
            f" ixx, iyy, izz = {would}"
        )
        impossible[link] = note, box
    return impossible


_SENSORS = ("camera", "depth", "rgbd_camera")
"""Types of Gazebo's sensors that give images, by preference."""
_SKID = {"side_friction": 0.2, "skid": 0.08}  # measured
"""What a body with two or more wheels on a side gets: the figures measured for Husky."""
_DIFFERENT = 0.02  # chosen
"""Share by which a value of the robot file differs from the URDF's before it is told."""
_PLACES = 6  # chosen


def measured(model: UrdfModel, said: dict[str, Any]) -> dict[str, Any]:
    """Derive keys of a robot file from the URDF; ``said`` is that file's part ``urdf``.

    Raises:
        ConfigError: the file names no wheels, and the URDF has none in pairs.

    """
    left, right = _sides(model, said)
    wheels = [model.joints[name] for name in (*left, *right) if name in model.joints]
    if len(wheels) < len(left) + len(right):
        return {}  # the check of the named wheels says what is wrong
    centres = np.array([model.frame_of(wheel.child)[:3, 3] for wheel in wheels])
    radius = next((r for wheel in wheels if (r := model.wheel_radii.get(wheel.child))), None)
    urdf: dict[str, Any] = {"left": left, "right": right, "casters": _casters(model, wheels)}
    values: dict[str, Any] = {"urdf": urdf}
    if len(left) > 1:
        urdf["side_friction"], values["skid"] = _SKID["side_friction"], _SKID["skid"]
    track = centres[: len(left), 1].mean() - centres[len(left) :, 1].mean()
    values["track"] = round(float(track), _PLACES)
    camera, link = _camera(model)
    values["camera"] = camera
    if link is not None:
        urdf["camera"] = link
    if radius is None:
        return values
    values["wheel_radius"] = radius
    ahead = float(said.get("turning_point") or 0.0)
    middle = centres[:, :2].mean(axis=0)
    floor = float(centres[:, 2].min()) - float(said.get("wheel_radius") or radius)
    shapes = ((c, product(model.frame_of(c.link), c.frame)) for c in model.collisions)
    extent = _extent(shapes)
    if extent is not None:
        low, high = extent - np.array([middle[0] + ahead, middle[1], floor])
        width = 2.0 * max(-low[1], high[1])
        body = {"front": high[0], "rear": -low[0], "width": width}
        values["footprint"] = {key: round(float(size), _PLACES) for key, size in body.items()}
        eye = CameraModel().mount_height  # of a camera that the URDF does not have
        if link is not None:
            eye = float(model.frame_of(link)[2, 3]) - floor
        else:
            camera["mount_forward"] = min(CameraModel().mount_forward, body["front"])
        values["height"] = round(max(float(high[2]), eye), _PLACES)
    return values


def _sides(model: UrdfModel, said: dict[str, Any]) -> tuple[list[str], list[str]]:
    """The wheel joints, left and right: those named, or all pairs that nothing movable carries."""
    if said.get("left") and said.get("right"):
        return list(said["left"]), list(said["right"])
    wheels = [
        joint
        for joint in model.joints.values()
        if _rolls(model, joint) and not any(above.movable for above in model.above(joint.parent))
    ]
    at = {joint.name: float(model.frame_of(joint.child)[1, 3]) for joint in wheels}
    middle = sum(at.values()) / max(len(at), 1)
    left = [name for name, y in at.items() if y > middle + 1e-3]
    right = [name for name, y in at.items() if y < middle - 1e-3]
    if not left or len(left) != len(right):
        raise ConfigError(
            f"has no wheels in pairs, but {sorted(at) or 'no continuous joint across the body'}:"
            " name them in a robot file with urdf: {file, left, right}",
            file=shown_path(model.file),
        )
    return left, right


def _casters(model: UrdfModel, wheels: list[UrdfJoint]) -> list[str]:
    """Joints called casters, and of the other wheels and their swivels."""
    names = {wheel.name for wheel in wheels}
    return [
        joint.name
        for joint in model.joints.values()
        if joint.name not in names
        and (re.search("cast[eo]r", f"{joint.name} {joint.child}".lower()) or _rolls(model, joint))
    ]


def _rolls(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Whether the joint turns without end about an axis across the body."""
    return joint.kind == "continuous" and abs(axis_across(model, joint.name)) >= ACROSS


def _extent(shapes: Iterable[tuple[UrdfCollision, Array]]) -> tuple[Array, Array] | None:
    """Least and greatest (3,) [m] of shapes at frames (4, 4); None without any, or with a mesh."""
    lows, highs = [], []
    for collision, frame in shapes:
        if collision.size is None:
            return None
        turn, half = frame[:3, :3], 0.5 * collision.size
        if collision.shape.tag == "box":
            reach = product(np.abs(turn), half)
        elif collision.shape.tag == "cylinder":
            across = np.sqrt(np.maximum(1.0 - np.square(turn[:, 2]), 0.0))
            reach = half[2] * np.abs(turn[:, 2]) + collision.radius * across
        else:
            reach = np.full(3, collision.radius)
        lows.append(frame[:3, 3] - reach)
        highs.append(frame[:3, 3] + reach)
    return (np.min(lows, axis=0), np.max(highs, axis=0)) if lows else None


def _camera(model: UrdfModel) -> tuple[dict[str, Any], str | None]:
    """Keys of the camera by Gazebo's first sensor with images, and the link that it is at."""
    sensors = [
        (gazebo.get("reference", ""), sensor)
        for kind in _SENSORS
        for gazebo in model.root.iterfind("gazebo")
        for sensor in gazebo.iterfind(f"sensor[@type='{kind}']")
    ]
    if not sensors:
        names = (n for n in model.links if "camera" in n.lower() and "optical" not in n.lower())
        return {}, next(names, None)
    link, sensor = sensors[0]
    keys = {
        "hfov": "camera/horizontal_fov",
        "width": "camera/image/width",
        "height": "camera/image/height",
        "rate": "update_rate",
    }
    read: dict[str, Any] = {}
    for key, place in keys.items():
        text = (sensor.findtext(place) or "").strip()
        if re.fullmatch(r"[0-9]+\.?[0-9]*", text):
            read[key] = int(text) if key in {"width", "height"} else float(text)
    return read, link if link in model.links else None


def robot_notes(robot: RobotModel) -> tuple[str, ...]:
    """Return notes on a checked robot: impossible inertias, values other than its URDF's."""
    urdf = robot.urdf
    if urdf is None:
        return ()
    file = Path(urdf.file)
    model = read_urdf(file, urdf.packages)
    said = urdf.model_dump() | {"wheel_radius": robot.wheel_radius}
    read = measured(model, said)
    own = robot.model_dump()
    notes = [
        f"{shown_path(file)}: {key} is {value:g}, the robot has {other:g}"
        for key, value, other in _pairs("", read, own)
        if abs(value - other) > _DIFFERENT * max(abs(value), abs(other))
        and not (key == "camera.hfov" and robot.camera.calibration)
    ]
    if urdf.camera is None and not {"mount_height"} & robot.camera.model_fields_set:
        height = robot.camera.mount_height
        notes.append(f"{shown_path(file)} has no camera: taken to be {height:g} m above the floor")
    return (*(note for note, _ in impossible_inertias(robot, model).values()), *notes)


def _pairs(at: str, read: dict[str, Any], own: dict[str, Any]) -> list[tuple[str, float, float]]:
    """Keys with the numbers of both, of the parts that the robot has."""
    pairs = []
    for key, value in read.items():
        other = own.get(key)
        if isinstance(value, dict) and isinstance(other, dict):
            pairs += _pairs(f"{at}{key}.", value, other)
        elif isinstance(value, int | float) and isinstance(other, int | float):
            pairs.append((f"{at}{key}", float(value), float(other)))
    return pairs
