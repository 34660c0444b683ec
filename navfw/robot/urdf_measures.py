"""Measure a robot in its URDF, wheels, track, body and camera; find values that disagree.

A robot file on a URDF has these values beneath its own; ``--robot FILE.urdf`` has only these.
Inertia that no body of that mass and size can have is replaced: published files have 1 kg m^2 on a
plate of 10 g, which makes a body that follows no command.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from navfw.assumption import Assumption
from navfw.config.foreign_files import element_error
from navfw.config.input_file import shown_path
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product, sum_in_order
from navfw.robot import CameraModel, DrivenUrdf, RobotModel
from navfw.robot.urdf_camera import camera_assumed, camera_of
from navfw.robot.urdf_drive import ACROSS, axis_across, axis_of, model_of, urdf_drive
from navfw.robot.urdf_meshes import mesh_corners
from navfw.robot.urdf_model import (
    MOMENTS,
    UrdfJoint,
    UrdfModel,
    attribute_numbers,
    origin_frame,
)

_DENSITY = 1000.0  # derived
"""Density [kg/m^3] of the cube that replaces a link without a shape: that of water."""

_ROOM, _WIDE_ROOM = 1.5, 3.0  # chosen
"""Factors on the reach of a link's collision shapes, of which more may be seen, and on the size of
the robot for one without a shape or with a mesh."""

_MIN_MOMENT, _NEGLIGIBLE = 1e-3, 1e-3  # chosen
"""Least principal moment, as a share of the box's or a rod's about its own axis; and a moment that
is negligible, as a share of the robot's mass times its squared size."""

_ROUNDING = 1.02  # derived
"""Largest principal moment over the sum of the others, which it exceeds only by rounding."""


def impossible_inertias(
    robot: RobotModel, model: UrdfModel
) -> dict[str, tuple[Assumption, tuple[float, ...]]]:
    """Find links whose inertia no body can have, or that have none; return the moments of a box.

    A principal moment is not positive, exceeds the sum of the others, or is too large or too small
    for mass and collision shapes. The box [kg m^2, about x, y, z] has the link's mass and size.

    Raises:
        ConfigError: a moment is no finite number.

    """
    extent = max(2.0 * robot.reach, robot.height)
    total = sum_in_order(mass for mass, _ in model.inertials.values())
    impossible = {}
    for link, (mass, inertial) in model.inertials.items():
        element = next(inertial.iter("inertia"))
        moments = [attribute_numbers(element, key, [0.0])[0] for key in MOMENTS]
        xx, yy, zz, xy, xz, yz = moments
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        low, middle, high = np.linalg.eigvalsh(matrix).tolist()
        size, reach = np.full(3, (mass / _DENSITY) ** (1.0 / 3.0)), _WIDE_ROOM * extent
        shapes = _extent(model, link)
        if shapes is not None:
            centre = origin_frame(inertial.find("origin"))[:3, 3]
            size = shapes[1] - shapes[0]
            reach = _ROOM * math.hypot(*np.abs(np.array(shapes) - centre).max(axis=0))
        squares = size * size
        box = tuple((mass / 12.0 * (squares.sum() - squares)).tolist())
        closed = low > _MIN_MOMENT * min(box) and high <= _ROUNDING * (low + middle)
        if closed and high <= max(mass * reach**2, _NEGLIGIBLE * total * extent**2):
            continue
        have, would = (", ".join(f"{m:.2g}" for m in ms) for ms in ((low, middle, high), box))
        reason = f"no body of {mass:g} kg and its size has the principal moments {have} kg m^2"
        what = f"{element_error(element, f'inertia of link {link!r}')}"
        taken = f"that of a box, ixx, iyy, izz = {would}"
        reason = reason if any(moments) else "the file gives none"
        impossible[link] = Assumption(what, taken, reason), box
    return impossible


_SKID = {"side_friction": 0.2, "skid": 0.08}  # measured
"""Values for a body with two or more wheels on a side: those measured for Husky."""
_DIFFERENT = 0.02  # chosen
"""Share by which a value of the robot file may differ from the URDF's without a note."""
_LIFTS = 0.005  # chosen
"""Depth [m] that a link may reach below the wheels without a note: deeper it may lift them."""
_PLACES = 6  # chosen
_OFF_THE_FLOOR = 0.03  # chosen
"""Height [m] above the lowest wheel up to which a wheel or caster counts as on the floor."""
_FIXED = "is fixed"
_TURNING = ("continuous", "revolute")
"""Types of joints that steer the links below them."""


def measured(model: UrdfModel, said: dict[str, Any]) -> dict[str, Any]:
    """Derive keys of a robot file from the URDF; ``said`` is that file's part ``urdf``.

    Raises:
        ConfigError: the file names no wheels, and the URDF has none in pairs.

    """
    left, right = _sides(model, said)
    wheels = [model.joints[name] for name in dict.fromkeys((*left, *right)) if name in model.joints]
    if len(wheels) < len(left) + len(right):
        return {}  # the check of the named wheels says what is wrong
    centres = np.array([model.frame_of(wheel.child)[:3, 3] for wheel in wheels])
    radius = next((r for wheel in wheels if (r := _radius(model, wheel))), None)
    urdf: dict[str, Any] = {"left": left, "right": right, "casters": _casters(model, wheels)}
    values: dict[str, Any] = {"urdf": urdf}
    if len(left) > 1:
        urdf["side_friction"], values["skid"] = _SKID["side_friction"], _SKID["skid"]
    track = centres[: len(left), 1].mean() - centres[len(left) :, 1].mean()
    if track <= 0.0:
        what = f"{left[0]!r}, a left wheel, is not left of {right[0]!r}: exchange left and right"
        raise ConfigError(what, file=shown_path(model.file))
    values["track"] = round(float(track), _PLACES)
    camera, link, eye = camera_of(model)
    values["camera"] = camera
    if link is not None:
        urdf["camera"] = link
    if radius is None:
        return values
    values["wheel_radius"] = round(radius, _PLACES)
    ahead = float(said.get("turning_point") or 0.0)
    middle = centres[:, :2].mean(axis=0)
    floor = float(centres[:, 2].min()) - float(said.get("wheel_radius") or radius)
    extents = [e for link in model.links if (e := _extent(model, link, model.frame_of(link)))]
    if extents:
        extent = np.min([e[0] for e in extents], axis=0), np.max([e[1] for e in extents], axis=0)
        low, high = extent - np.array([middle[0] + ahead, middle[1], floor])
        width = 2.0 * max(-low[1], high[1])
        body = {"front": high[0], "rear": -low[0], "width": width}
        values["footprint"] = {key: round(float(size), _PLACES) for key, size in body.items()}
        if link is None:  # a camera that the URDF does not have
            eye = CameraModel().mount_height + floor
            camera["mount_forward"] = min(CameraModel().mount_forward, body["front"])
        values["height"] = round(max(float(high[2]), eye - floor), _PLACES)
    return values


def _sides(model: UrdfModel, said: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return the wheel joints, left and right: those named, or all pairs on the floor."""
    if said.get("left") and said.get("right"):
        return list(said["left"]), list(said["right"])
    why = {joint.name: _no_wheel(model, joint) for joint in model.joints.values()}
    wheels = [model.joints[name] for name, reason in why.items() if not reason]
    low = {wheel.name: _lowest(model, wheel.child) for wheel in wheels}
    floor = min(low.values(), default=0.0) + _OFF_THE_FLOOR
    at = {w.name: model.frame_of(w.child)[1, 3] for w in wheels if low[w.name] <= floor}
    middle = sum(at.values()) / max(len(at), 1)
    left = [name for name, y in at.items() if y > middle + 1e-3]
    right = [name for name, y in at.items() if y < middle - 1e-3]
    if not left or len(left) != len(right):
        joints = [f"{name!r} {why[name] or 'is a wheel'}" for name in why if why[name] != _FIXED]
        raise ConfigError(
            f"has no wheels in pairs left and right: {'; '.join(joints) or 'all joints are fixed'};"
            " wheels have continuous joints across a body of which x is ahead: change the file, or"
            " name them in a robot file with urdf: {file, left, right}",
            file=shown_path(model.file),
        )
    return left, right


def _no_wheel(model: UrdfModel, joint: UrdfJoint) -> str:
    """Return why a joint is not that of a driven wheel; "" if it may be."""
    if joint.kind != "continuous":
        return _FIXED if joint.kind == "fixed" else f"is {joint.kind} with limits"
    if abs(axis_across(model, joint.name)) < ACROSS:
        return "has an axis that is not across the body"
    carrier = next((a for a in model.above(joint.parent) if a.kind in _TURNING), None)
    return f"hangs on {carrier.name!r}, which turns" if carrier else ""


def _casters(model: UrdfModel, wheels: list[UrdfJoint]) -> list[str]:
    """Return joints named casters, those of other wheels and balls on the floor, and swivels."""
    driven = {wheel.name for wheel in wheels}
    floor = min(_lowest(model, wheel.child) for wheel in wheels) + _OFF_THE_FLOOR
    low = {link for link in model.links if _lowest(model, link) <= floor}
    carriers = {joint.name for link in low for joint in model.above(link)}
    balls = {c.link for c in model.collisions if c.shape.tag == "sphere"} & low
    casters = []
    for joint in model.joints.values():
        named = re.search("cast[eo]r", f"{joint.name} {joint.child}".lower())
        turns = joint.kind == "continuous" and joint.name in carriers
        axis = np.abs(axis_of(model, joint.name))
        rolls_or_swivels = turns and max(axis[1], axis[2]) >= ACROSS
        if joint.name not in driven and (named or rolls_or_swivels or joint.child in balls):
            casters.append(joint.name)
    return casters


def _lowest(model: UrdfModel, link: str) -> float:
    """Return the height [m] of a link's lowest point in the root link; its origin's if no shape."""
    frame = model.frame_of(link)
    extent = _extent(model, link, frame)
    return float(frame[2, 3] if extent is None else extent[0][2])


def _radius(model: UrdfModel, wheel: UrdfJoint) -> float | None:
    """Return a wheel's radius [m]: a mesh's largest distance from its axis, its height, or None."""
    shapes = [c for c in model.collisions if c.link == wheel.child]
    meshes = [c for c in shapes if c.size is None]
    if len(shapes) > len(meshes):
        below = float(model.frame_of(wheel.child)[2, 3]) - _lowest(model, wheel.child)
        return model.wheel_radii.get(wheel.child, below)
    if not meshes:
        return None
    axis = wheel.axis / max(math.hypot(*wheel.axis), 1e-9)
    corners = np.concatenate([_points(mesh_corners(model, c.shape), c.frame) for c in meshes])
    across = corners - product(corners, axis)[:, None] * axis
    return float(np.linalg.norm(across, axis=1).max())


def _points(corners: Array, frame: Array) -> Array:
    """Return points (N, 3) [m] moved by ``frame`` (4, 4)."""
    points: Array = product(corners, frame[:3, :3].T) + frame[:3, 3]
    return points


def _extent(model: UrdfModel, link: str, at: Array | None = None) -> tuple[Array, Array] | None:
    """Return least and largest (3,) [m] of a link's shapes, in ``at``'s axes; None if no shape."""
    lows, highs = [], []
    for collision in (c for c in model.collisions if c.link == link):
        frame = collision.frame if at is None else product(at, collision.frame)
        turn, centre = frame[:3, :3], frame[:3, 3]
        if collision.size is None:
            points = _points(mesh_corners(model, collision.shape), frame)
            low, high = points.min(axis=0), points.max(axis=0)
            centre, reach = 0.5 * (low + high), 0.5 * (high - low)
        elif collision.shape.tag == "box":
            reach = product(np.abs(turn), 0.5 * collision.size)
        elif collision.shape.tag == "cylinder":
            across = np.sqrt(np.maximum(1.0 - np.square(turn[:, 2]), 0.0))
            reach = 0.5 * collision.size[2] * np.abs(turn[:, 2]) + collision.radius * across
        else:
            straight = 0.5 * collision.size[2] - collision.radius
            reach = straight * np.abs(turn[:, 2]) + collision.radius
        lows.append(centre - reach)
        highs.append(centre + reach)
    return (np.min(lows, axis=0), np.max(highs, axis=0)) if lows else None


def robot_notes(robot: RobotModel) -> tuple[str, ...]:
    """Say where values of a checked robot differ from its URDF's, and what may lift its wheels."""
    urdf = robot.urdf
    if urdf is None:
        return ()
    own, model, file = robot.model_dump(), model_of(urdf), shown_path(Path(urdf.file))
    floor = float(urdf_drive(robot, model).origin[2])
    below = {link: floor - low for link in model.links if (low := _lowest(model, link)) < floor}
    return (
        *(
            f"{file}: {key} is {value:g}, the robot has {other:g}"
            for key, value, other in _pairs("", _read(robot, urdf, model), own)
            if abs(value - other) > _DIFFERENT * max(abs(value), abs(other))
            and not (key == "camera.hfov" and robot.camera.calibration)
        ),
        *(
            f"{file}: link {link!r} reaches {depth:.3g} m below the wheels, which it may lift"
            for link, depth in below.items()
            if depth > _LIFTS and any(c.link == link for c in model.collisions)
        ),
    )


def robot_assumed(robot: RobotModel) -> tuple[Assumption, ...]:
    """Return the assumptions on a checked robot that its URDF leaves open, or has impossible."""
    urdf = robot.urdf
    if urdf is None:
        return ()
    model = model_of(urdf)
    turning = [name for name in (*urdf.left, *urdf.right, *urdf.casters) if name in model.unlimited]
    assumed = [
        *(assumption for assumption, _ in impossible_inertias(robot, model).values()),
        *(Assumption(f"joint {name!r}", "turns without end", _NO_LIMIT) for name in turning),
    ]
    above = (one for name in urdf.casters for one in model.above(model.joints[name].parent))
    steering = dict.fromkeys(joint.name for joint in above if joint.kind == "revolute")
    assumed += [Assumption(f"joint {name!r}", "held straight", _BY_SPEEDS) for name in steering]
    if "wheel_radius" not in robot.model_fields_set:
        taken = f"{robot.wheel_radius:g} m"
        assumed += [Assumption("wheel radius", taken, "no wheel has a shape", "wheel_radius")]
    if model.seen:
        links = ", ".join(dict.fromkeys(model.seen))
        assumed += [Assumption(f"shapes of {links}", "what is seen", "nothing of them collides")]
    collisions = model.collisions
    meshes = list(dict.fromkeys(c.shape.get("filename", "") for c in collisions if c.size is None))
    footprint = robot.footprint
    if meshes and footprint and _read(robot, urdf, model).get("footprint") == dict(footprint):
        size = f"{footprint.front + footprint.rear:.3g} x {footprint.width:.3g} m"
        others = f" and {len(meshes) - 1} more" * (len(meshes) > 1)
        reason = f"the extent of its shapes, {Path(meshes[0]).name}{others}"
        assumed += [Assumption("footprint", size, reason, "footprint")]
    camera = robot.camera
    if urdf.camera is not None and not {"hfov", "calibration"} & camera.model_fields_set:
        size = f"{camera.width} x {camera.height} pixels, {camera.rate:g} Hz"
        taken = f"{math.degrees(camera.hfov):.0f} degrees wide, {size}"
        assumed += [Assumption("images", taken, "no sensor of a camera says it", "camera.hfov")]
    if urdf.camera is not None:
        assumed += camera_assumed(model, urdf.camera, urdf_drive(robot, model).origin)
    elif not {"mount_height"} & camera.model_fields_set:
        taken = f"{camera.mount_height:g} m above the floor"
        reason = f"{shown_path(Path(urdf.file))} has none"
        assumed += [Assumption("camera", taken, reason, "camera.mount_height")]
    return tuple(assumed)


_NO_LIMIT = "its limits allow more than a turn, or it has none"
_BY_SPEEDS = "the robot steers by the speeds of its wheels"


def _read(robot: RobotModel, urdf: DrivenUrdf, model: UrdfModel) -> dict[str, Any]:
    """Return the values measured from the URDF of the robot."""
    return measured(model, urdf.model_dump() | {"wheel_radius": robot.wheel_radius})


def _pairs(at: str, read: dict[str, Any], own: dict[str, Any]) -> list[tuple[str, float, float]]:
    """Return keys with the numbers of both, where both have one."""
    pairs = []
    for key, value in read.items():
        other = own.get(key)
        if isinstance(value, dict) and isinstance(other, dict):
            pairs += _pairs(f"{at}{key}.", value, other)
        elif isinstance(value, int | float) and isinstance(other, int | float):
            pairs.append((f"{at}{key}", float(value), float(other)))
    return pairs
