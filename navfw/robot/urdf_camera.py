"""Find the camera of a URDF: the sensor or link that looks ahead, its mount, Gazebo's data.

A camera looks along the x axis of its link, or of the pose of Gazebo's <sensor>; on an optical
frame (x right, y down) along z. The camera of a robot looks ahead: yaw and roll are not supported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from navfw.assumption import Assumption
from navfw.config.foreign_files import numbers_in
from navfw.config.input_file import shown_path
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.robot.sdf_pose import sdf_pose
from navfw.robot.urdf_model import UrdfModel

_SENSORS = ("camera", "rgbd_camera", "rgbd", "depth", "depth_camera", "multicamera")
"""Types of Gazebo's sensors that give images, the preferred ones first."""
_MAX_SKEW = math.radians(5.0)  # chosen
"""Largest yaw and roll [rad] of a camera that looks ahead: they are ignored."""
_MAX_PITCH = 1.0  # defined
"""Bound of the pitch [rad] of a CameraModel."""
_DOWN = -0.7  # chosen
"""Upward component of a y axis below which the frame counts as an optical one."""
_OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Turns axes x ahead, z up into those of an optical frame."""
_KEYS = {
    "hfov": "camera/horizontal_fov",
    "width": "camera/image/width",
    "height": "camera/image/height",
    "rate": "update_rate",
}
"""Keys of a camera, and their paths in a <sensor>."""


@dataclass(frozen=True)
class _CameraView:
    """A camera at ``link``: ``frame`` (4, 4) in the root link, x along its view.

    ``sensor`` is None for a link with the name of a camera; ``optical``: its link looks along z.
    """

    link: str
    sensor: Element | None
    frame: Array
    optical: bool

    @property
    def angles(self) -> tuple[float, float, float]:
        """Yaw to the left, pitch down, and roll about the direction in which it looks [rad]."""
        (ahead, _, _), (left, _, _), (up, y, z) = self.frame[:3, :3].tolist()
        return math.atan2(left, ahead), math.asin(min(max(-up, -1.0), 1.0)), math.atan2(y, z)

    @property
    def ahead(self) -> bool:
        """Whether it looks ahead, with upright images."""
        yaw, pitch, roll = map(abs, self.angles)
        return pitch < _MAX_PITCH and max(yaw, roll) <= _MAX_SKEW


def _view(model: UrdfModel, link: str, sensor: Element | None = None) -> _CameraView:
    at = frame = model.frame_of(link)
    if sensor is not None and (pose := sensor.find("pose")) is not None:
        frame = product(at, sdf_pose(pose))
    turned = not np.array_equal(frame, at)
    optical = bool(frame[2, 1] < _DOWN) or ("optical" in link.lower() and not turned)
    if optical:
        frame = np.hstack([product(frame[:, :3], _OPTICAL), frame[:, 3:]])
    return _CameraView(link, sensor, frame, optical)


def _views(model: UrdfModel, link: str | None = None) -> list[_CameraView]:
    """Return the cameras at ``link``, or all: first those that look ahead, sensors by type.

    If there is no sensor, links whose names contain "camera", by name.
    """
    views = [
        _view(model, gazebo.get("reference", ""), sensor)
        for kind in _SENSORS
        for gazebo in model.root.iterfind("gazebo")
        for sensor in gazebo.iterfind(f"sensor[@type='{kind}']")
        if gazebo.get("reference") in ((link,) if link else model.links)
    ]
    if not views:
        named = [link] if link else [name for name in model.links if "camera" in name.lower()]
        views = [_view(model, name) for name in sorted(named, key=lambda name: "optical" in name)]
    return sorted(views, key=lambda view: not view.ahead)


def camera_of(model: UrdfModel) -> tuple[dict[str, Any], str | None, float]:
    """Return keys of the camera that looks ahead, its link, its height [m] above the root link.

    If none looks ahead it is the first, which ``mounted`` refuses. Without a camera the link is
    None.
    """
    views = _views(model)
    if not views:
        return {}, None, 0.0
    read: dict[str, Any] = {}
    for key, place in _KEYS.items():
        element = None if views[0].sensor is None else views[0].sensor.find(place)
        if element is not None:
            (number,) = numbers_in(element, element.text or "0", 1, element.tag)
            if number > 0.0:
                read[key] = round(number) if key in {"width", "height"} else number
    return read, views[0].link, float(views[0].frame[2, 3])


def mounted(camera: CameraModel, model: UrdfModel, link: str, origin: Array) -> CameraModel:
    """Return ``camera`` at ``link``; mount and pitch in the robot's file take precedence.

    Raises:
        ConfigError: the camera looks elsewhere than ahead, and no pitch is given.

    """
    view = _views(model, link)[0]
    if not (view.ahead or "pitch" in camera.model_fields_set):
        yaw, pitch, roll = map(math.degrees, view.angles)
        raise ConfigError(
            f"the camera at link {link!r} does not look ahead: yaw {yaw:.0f}, pitch {pitch:.0f}"
            f" (down), roll {roll:.0f} degrees; name another link, or give a robot file with"
            " camera: {mount_forward, mount_height, pitch}",
            file=shown_path(model.file),
        )
    mount = {
        "mount_forward": float(view.frame[0, 3] - origin[0]),
        "mount_height": float(view.frame[2, 3] - origin[2]),
        "pitch": view.angles[1],
    }
    from_file = {name: getattr(camera, name) for name in camera.model_fields_set}
    return camera.model_copy(update=mount | from_file)


def camera_assumed(model: UrdfModel, link: str, origin: Array) -> tuple[Assumption, ...]:
    """Return the assumptions about the camera at ``link``; ``origin`` is as in ``mounted``."""
    # links that are called cameras and look ahead are frames of one
    rest = [view for view in _views(model) if view.sensor is not None or not view.ahead]
    others = sorted({view.link for view in rest} - {link})
    view = _views(model, link)[0]
    reasons = [f"it looks ahead (others: {', '.join(others)})"] * bool(others)
    reasons += ["its frame is an optical one: z ahead"] * view.optical
    yaw, _, roll = map(math.degrees, view.angles)
    aside = float(view.frame[1, 3] - origin[1])
    left_out = [
        f"{abs(value):.2g} {unit}"
        for value, unit, least in (
            (aside, "m to the left" if aside > 0.0 else "m to the right", 0.02),
            (yaw, "degrees of yaw", 0.5),
            (roll, "degrees of roll", 0.5),
        )
        if abs(value) > least
    ]
    taken = f"the one at link {link!r}"
    if left_out:
        taken += f", in the middle and straight ({', '.join(left_out)} left out)"
    told = (Assumption("camera", taken, "; ".join(reasons), "urdf.camera"),)
    return told if left_out or reasons else ()
