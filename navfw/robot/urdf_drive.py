"""Derive the drive of a URDF: wheel joints, base_link, the camera at its link."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfw.config.document import YamlDocument
from navfw.config.yaml_text import KeyPath, key_text
from navfw.errors import ConfigError, UnknownNameError
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import DrivenUrdf, RobotModel
from navfw.robot.urdf import read_urdf
from navfw.robot.urdf_camera import mounted
from navfw.robot.urdf_model import UrdfModel

ACROSS = 0.99  # chosen
"""Least absolute component of a wheel joint's unit axis along the body's y axis."""
_RADIUS_TOLERANCE = 0.02  # chosen
"""Largest difference between a wheel's radius and its collision shape's, share of the radius."""


@dataclass(frozen=True)
class UrdfDrive:
    """The drive of a URDF: the names of its wheel joints, left and right, each with its sense.

    A ``sense`` is -1 if a positive speed drives backward. ``origin`` (3,) [m] is base_link in the
    root link's axes, on the floor where the body turns; ``supports`` (n, 2) [m] are the wheels'
    contact points in base_link. Joints in ``held`` stay at 0.
    """

    left: tuple[str, ...]
    right: tuple[str, ...]
    sense: dict[str, float]
    origin: Array
    supports: Array
    held: tuple[str, ...]
    model: UrdfModel


def model_of(urdf: DrivenUrdf) -> UrdfModel:
    """Read the URDF of a robot; see ``read_urdf``."""
    return read_urdf(Path(urdf.file), urdf.packages, urdf.args)


def with_urdf(robot: RobotModel, document: YamlDocument, at: KeyPath = ()) -> RobotModel:
    """Check ``robot``, read from part ``at`` of the document, with its URDF; mount its camera.

    Raises:
        ConfigError: the URDF cannot be used; a joint is no wheel, or the robot lacks a footprint.
        UnknownNameError: the URDF has no joint or link of a name; the message has the nearest.

    """
    urdf = robot.urdf
    if urdf is None:
        return robot
    with _place(document, at, "urdf", "file"):
        model = model_of(urdf)
    _check_wheels(urdf, model, document, at)
    if robot.footprint is None:
        with _place(document, at, "urdf"):
            raise ConfigError(
                "a body with a URDF without collision shapes and visuals needs a footprint:"
                " {front, rear, width} [m]"
            )
    for name in (*urdf.left, *urdf.right):
        radius = model.wheel_radii.get(model.joints[name].child)
        if radius and abs(radius / robot.wheel_radius - 1.0) > _RADIUS_TOLERANCE:
            what = f"wheels of {robot.wheel_radius:g} m, but that of {name!r} has a radius of"
            with _place(document, at, "wheel_radius"):
                raise ConfigError(f"{what} {radius:g} m: give that, or name wheels of one size")
    for index, name in enumerate(urdf.casters):
        if name not in model.joints:
            with _place(document, at, "urdf", "casters", index):
                raise UnknownNameError("joint of the URDF", name, model.joints)
    if urdf.camera is None:
        return robot
    if urdf.camera not in model.links:
        with _place(document, at, "urdf", "camera"):
            raise UnknownNameError("link of the URDF", urdf.camera, model.links)
    with _place(document, at, "urdf", "camera"):
        camera = mounted(robot.camera, model, urdf.camera, urdf_drive(robot, model).origin)
    return robot.model_copy(update={"camera": camera})


def urdf_drive(robot: RobotModel, model: UrdfModel | None = None) -> UrdfDrive:
    """Derive the drive of a checked robot with a URDF; ``model`` is that file if already read."""
    urdf = robot.urdf
    if urdf is None:
        raise ValueError("the robot has no URDF")
    model = model_of(urdf) if model is None else model
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
    """Context in which errors get the place of this key of the robot."""
    return document.locating((*at, *key), key=key_text(key))


def _check_wheels(urdf: DrivenUrdf, model: UrdfModel, document: YamlDocument, at: KeyPath) -> None:
    """Check that the named joints are wheels, each named once."""
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


def axis_across(model: UrdfModel, joint: str) -> float:
    """Return the leftward component of a joint's unit axis in the root link, -1 to 1."""
    return float(axis_of(model, joint)[1])


def axis_of(model: UrdfModel, joint: str) -> Array:
    """Return a joint's unit axis (3,) in the root link."""
    wheel = model.joints[joint]
    axis: Array = product(model.frame_of(wheel.child)[:3, :3], wheel.axis)
    return axis / max(math.hypot(*axis), 1e-9)
