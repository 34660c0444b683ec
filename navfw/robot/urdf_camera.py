"""The camera of a URDF: the sensor or link that looks ahead, its mount, and what Gazebo says of it.

A camera looks along the x axis of its link, or of the pose of Gazebo's <sensor>; on an optical
frame (x right, y down) along z. The camera of a robot looks ahead: yaw and roll are not supported.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from navfw.assumption import Assumption
from navfw.config.input_file import shown_path
from navfw.errors import ConfigError
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.robot.sdf_pose import sdf_pose
from navfw.robot.urdf_model import UrdfModel

_SENSORS = ("camera", "rgbd_camera", "rgbd", "depth", "depth_camera", "multicamera")
"""Types of Gazebo's sensors that give images, by preference."""
_MAX_SKEW = math.radians(5.0)  # chosen
"""Largest yaw and roll [rad] of a camera that looks ahead: they are left out."""
_MAX_PITCH = 1.0  # defined
"""Bound of the pitch [rad] of a CameraModel."""
_DOWN = -0.7  # chosen
"""Upward component of a y axis below which the frame is an optical one."""
_OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Turns axes x ahead, z up into those of an optical frame."""
_KEYS = {
    "hfov": "camera/horizontal_fov",
    "width": "camera/image/width",
    "height": "camera/image/height",
    "rate": "update_rate",
}
"""Keys of a camera, and where a <sensor> has them."""


@dataclass(frozen=True)
class _CameraView:
    """Where a camera at ``link`` is: ``frame`` (4, 4) in the root link, x ahead; its angles [rad].

    Without a ``sensor`` it is a link that is called a camera; ``optical``: its link looks along z.
    """

    link: str
    sensor: Element | None
    frame: Array
    optical: bool

    @property
    def pitch(self) -> float:
        """Nose-down positive."""
        return math.asin(min(max(float(-self.frame[2, 0]), -1.0), 1.0))

    @property
    def yaw(self) -> float:
        """To the left."""
        return math.atan2(self.frame[1, 0], self.frame[0, 0])

    @property
    def roll(self) -> float:
        """About the direction in which it looks."""
        return math.atan2(self.frame[2, 1], self.frame[2, 2])

    @property
    def ahead(self) -> bool:
        """Whether it looks ahead, its images upright."""
        skew = max(abs(self.yaw), abs(self.roll))
        return abs(self.pitch) < _MAX_PITCH and skew <= _MAX_SKEW


def _view(model: UrdfModel, link: str, sensor: Element | None = None) -> _CameraView:
    frame = model.frame_of(link)
    pose = None if sensor is None else sensor.find("pose")
    if pose is not None:
        frame = product(frame, sdf_pose(pose, shown_path(model.file)))
    turned = pose is not None and not np.array_equal(frame, model.frame_of(link))
    optical = frame[2, 1] < _DOWN or ("optical" in link.lower() and not turned)
    if optical:
        frame = frame.copy()
        frame[:3, :3] = product(frame[:3, :3], _OPTICAL)
    return _CameraView(link, sensor, frame, optical)


def _views(model: UrdfModel, link: str | None = None) -> list[_CameraView]:
    """The cameras at ``link``, or at any, by preference: sensors, or links called so."""
    views = [
        _view(model, gazebo.get("reference", ""), sensor)
        for kind in _SENSORS
        for gazebo in model.root.iterfind("gazebo")
        for sensor in gazebo.iterfind(f"sensor[@type='{kind}']")
        if gazebo.get("reference") in ((link,) if link else model.links)
    ]
    if views or link:
        return views or [_view(model, str(link))]
    named = [name for name in model.links if "camera" in name.lower()]
    return [_view(model, name) for name in sorted(named, key=lambda name: "optical" in name)]


def _ahead(views: list[_CameraView]) -> _CameraView:
    """The first that looks ahead, or the first."""
    return next((view for view in views if view.ahead), views[0])


def camera_of(model: UrdfModel) -> tuple[dict[str, Any], str | None, float]:
    """Keys of the camera that looks ahead, its link, and its height [m] above the root link.

    Where none looks ahead it is the first, which ``mounted`` refuses. Without a camera the link is
    None.
    """
    views = _views(model)
    if not views:
        return {}, None, 0.0
    view = _ahead(views)
    read: dict[str, Any] = {}
    sensor = Element("sensor") if view.sensor is None else view.sensor
    for key, place in _KEYS.items():
        text = (sensor.findtext(place) or "").strip()
        if re.fullmatch(r"[0-9]+\.?[0-9]*", text) and float(text) > 0.0:
            read[key] = int(text) if key in {"width", "height"} else float(text)
    return read, view.link, float(view.frame[2, 3])


def mounted(camera: CameraModel, model: UrdfModel, link: str, origin: Array) -> CameraModel:
    """``camera`` at ``link``; what the robot's file says of mount and pitch takes precedence.

    Raises:
        ConfigError: the camera looks elsewhere than ahead, and no pitch is given.

    """
    view = _ahead(_views(model, link))
    if not (view.ahead or "pitch" in camera.model_fields_set):
        yaw, pitch, roll = (math.degrees(angle) for angle in (view.yaw, view.pitch, view.roll))
        raise ConfigError(
            f"the camera at link {link!r} does not look ahead: yaw {yaw:.0f}, pitch {pitch:.0f}"
            f" (down), roll {roll:.0f} degrees; name another link, or give a robot file with"
            " camera: {mount_forward, mount_height, pitch}",
            file=shown_path(model.file),
        )
    mount = {
        "mount_forward": float(view.frame[0, 3] - origin[0]),
        "mount_height": float(view.frame[2, 3] - origin[2]),
        "pitch": view.pitch,
    }
    from_file = {name: getattr(camera, name) for name in camera.model_fields_set}
    return camera.model_copy(update=mount | from_file)


def camera_assumed(model: UrdfModel, link: str, origin: Array) -> tuple[Assumption, ...]:
    """What is taken of the camera at ``link``; ``origin`` (3,) [m] is base_link's in the root."""
    # links that are called cameras and look ahead are frames of one
    rest = [view for view in _views(model) if view.sensor is not None or not view.ahead]
    others = sorted({view.link for view in rest} - {link})
    view = _ahead(_views(model, link))
    reasons = [f"it looks ahead (others: {', '.join(others)})"] if others else []
    if view.optical:
        reasons += ["its frame is an optical one: z ahead"]
    aside = float(view.frame[1, 3] - origin[1])
    left_out = [
        f"{abs(value):.2g} {unit}"
        for value, unit, least in (
            (aside, "m to the left" if aside > 0.0 else "m to the right", 0.02),
            (math.degrees(view.yaw), "degrees of yaw", 0.5),
            (math.degrees(view.roll), "degrees of roll", 0.5),
        )
        if abs(value) > least
    ]
    taken = f"the one at link {link!r}"
    if left_out:
        taken += f", in the middle and straight ({', '.join(left_out)} left out)"
    told = (Assumption("camera", taken, "; ".join(reasons), "urdf.camera"),)
    return told if left_out or reasons else ()
