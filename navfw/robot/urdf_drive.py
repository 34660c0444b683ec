"""The drive of a robot with a URDF: its wheel joints, base_link on the floor, the camera."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.config.document import KeyPath, YamlDocument, key_text
from navfw.errors import ConfigError, UnknownNameError
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import CameraModel, DrivenUrdf, RobotModel
from navfw.robot.urdf import UrdfModel, read_urdf

_ACROSS = 0.99
"""Least share of a wheel's axis that is across the body."""
_RADIUS_TOLERANCE = 0.02
"""Largest difference between a wheel's radius and its collision shape's, share of the radius."""


@dataclass(frozen=True)
class UrdfDrive:
    """How a URDF is driven: the names of its wheel joints, left and right, each with its sense.

    A ``sense`` is -1 where a positive speed drives backward. ``origin`` (3,) [m] is base_link in
    the root link's axes, on the floor where the body turns; ``supports`` (n, 2) [m] are the
    wheels' contact points in base_link. ``held`` joints stay at 0, ``massless`` links have no
    inertia in the file.
    """

    left: tuple[str, ...]
    right: tuple[str, ...]
    sense: dict[str, float]
    origin: Array
    supports: Array
    held: tuple[str, ...]
    massless: frozenset[str]


def with_urdf(robot: RobotModel, document: YamlDocument, at: KeyPath = ()) -> RobotModel:
    """``robot``, of the document's part ``at``, checked against its URDF, with the camera mounted.

    Raises:
        ConfigError: the URDF cannot be used; a joint is no wheel, or the robot lacks a footprint.
        UnknownNameError: the URDF has no joint or link of a name; the message has the nearest.

    """
    urdf = robot.urdf
    if urdf is None:
        return robot
    where = _Where(document, at)
    if robot.footprint is None:
        raise where.error("a body with a URDF needs a footprint: {front, rear, width} [m]", "urdf")
    try:
        model = read_urdf(Path(urdf.file))
    except ConfigError as error:
        raise where.error(str(error), "urdf", "file") from None
    _check_wheels(urdf, robot.wheel_radius, model, where)
    for index, name in enumerate(urdf.casters):
        if name not in model.joints:
            raise where.unknown("joint", name, model.joints, "urdf", "casters", index)
    if urdf.camera is None:
        return robot
    if urdf.camera not in model.links:
        raise where.unknown("link", urdf.camera, model.links, "urdf", "camera")
    origin = urdf_drive(robot, model).origin
    return robot.model_copy(update={"camera": _mounted(robot.camera, model, urdf.camera, origin)})


def urdf_drive(robot: RobotModel, model: UrdfModel | None = None) -> UrdfDrive:
    """The drive of a checked robot with a URDF; ``model`` is that file if already read."""
    urdf = robot.urdf
    if urdf is None:
        raise ValueError("the robot has no URDF")
    model = read_urdf(Path(urdf.file)) if model is None else model
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
        sense={name: math.copysign(1.0, _axis_across(model, name)) for name in wheels},
        origin=origin,
        supports=centres[:, :2] - origin[:2],
        held=tuple(j.name for j in model.joints.values() if j.movable and j.name not in kept),
        massless=model.massless,
    )


class _Where:
    """The part of a document that a robot comes from, for messages."""

    def __init__(self, document: YamlDocument, at: KeyPath) -> None:
        self._document, self._at = document, at

    def error(self, message: str, *key: str | int) -> ConfigError:
        """An error at this key of the robot."""
        origin = self._document.origin_of((*self._at, *key))
        named = origin.option or key_text(key)
        return ConfigError(message, file=origin.file, line=origin.line, key=named)

    def unknown(
        self, what: str, name: str, known: Iterable[str], *key: str | int
    ) -> UnknownNameError:
        """An error for a name that the URDF does not have."""
        origin = self._document.origin_of((*self._at, *key))
        named = origin.option or key_text(key)
        return UnknownNameError(
            f"{what} of the URDF", name, known, file=origin.file, line=origin.line, key=named
        )


def _check_wheels(urdf: DrivenUrdf, wheel_radius: float, model: UrdfModel, where: _Where) -> None:
    """Check that the named joints are wheels of this radius, each once."""
    seen: set[str] = set()
    turning = {name: joint for name, joint in model.joints.items() if joint.movable}
    for side in ("left", "right"):
        for index, name in enumerate(getattr(urdf, side)):
            at = ("urdf", side, index)
            if name not in turning:
                raise where.unknown("movable joint", name, tuple(turning), *at)
            if name in seen:
                raise where.error(f"the joint {name!r} is named twice: name each wheel once", *at)
            seen.add(name)
            if abs(_axis_across(model, name)) < _ACROSS:
                raise where.error(
                    f"the axis of {name!r} is not across the body: name a wheel's joint", *at
                )
            radius = model.wheel_radii.get(model.joints[name].child)
            if radius and abs(radius / wheel_radius - 1.0) > _RADIUS_TOLERANCE:
                raise where.error(
                    f"{wheel_radius:g} m, but the wheel of {name!r} has a radius of"
                    f" {radius:g} m: give that",
                    "wheel_radius",
                )


def _axis_across(model: UrdfModel, joint: str) -> float:
    """The share of a joint's axis that points left, -1 to 1."""
    found = model.joints[joint]
    axis = product(model.frame_of(found.child)[:3, :3], found.axis)
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
    given = {name: getattr(camera, name) for name in camera.model_fields_set}
    return camera.model_copy(update=mount | given)
