"""The window of PyBullet: it follows the robot, and shows lines over the world."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from navfw.errors import InputError
from navfw.sim.engine import bullet

Point3 = tuple[float, float, float]
"""x, y, z [m]."""

_OFF = (
    "COV_ENABLE_GUI",
    "COV_ENABLE_RGB_BUFFER_PREVIEW",
    "COV_ENABLE_DEPTH_BUFFER_PREVIEW",
    "COV_ENABLE_SEGMENTATION_MARK_PREVIEW",
    "COV_ENABLE_SHADOWS",
    "COV_ENABLE_KEYBOARD_SHORTCUTS",
    # a robot dragged by the mouse would drive otherwise
    "COV_ENABLE_MOUSE_PICKING",
)
"""What the window does not show or do: side panels without content, and shortcuts."""
_DISTANCE, _YAW, _PITCH = 5.0, -90.0, -60.0
"""The first view of the robot: distance [m], and PyBullet's angles of the camera [deg]."""
_WIDTH = 3.0
"""Width of lines [px]."""


def check_display() -> None:
    """Check that a window can be opened: without a display PyBullet ends the process silently.

    Raises:
        InputError: there is no display, or it cannot be opened.

    """
    if sys.platform != "linux":
        return
    name = os.environ.get("DISPLAY")
    if not name:
        raise InputError("needs a display, but DISPLAY is not set", key="--gui")
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        raise InputError("needs the library libX11, which is not installed", key="--gui") from None
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if display is None:
        raise InputError(f"the display {name!r} cannot be opened", key="--gui")
    x11.XCloseDisplay(ctypes.c_void_p(display))


class SimulatorWindow:
    """The window of the PyBullet client ``client``; nothing is drawn before ``show``.

    Positions are (x, y, z) [m] in ``map``, colours (red, green, blue) from 0 to 255.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._lines: dict[str, list[int]] = {}
        for flag in (*_OFF, "COV_ENABLE_RENDERING"):
            self._configure(flag, 0)

    def show(self, x: float, y: float) -> None:
        """Begin to draw, with the camera above (x, y) [m]."""
        self._call("resetDebugVisualizerCamera", _DISTANCE, _YAW, _PITCH, [x, y, 0.0])
        self._configure("COV_ENABLE_RENDERING", 1)

    def follow(self, x: float, y: float) -> None:
        """Move the camera along to (x, y) [m]; it keeps the distance and angles of the user."""
        *_, yaw, pitch, distance, _ = self._call("getDebugVisualizerCamera")
        self._call("resetDebugVisualizerCamera", distance, yaw, pitch, [x, y, 0.0])

    def draw(self, name: str, points: Sequence[Point3], color: tuple[int, int, int]) -> None:
        """Draw the line through ``points``, in place of the last one of this ``name``."""
        before = self._lines.get(name, [])
        now = []
        for number, ends in enumerate(pairwise(points)):
            replaced = before[number] if number < len(before) else -1
            now.append(self._line(*ends, color, replaced))
        for item in before[len(now) :]:
            self._call("removeUserDebugItem", item)
        self._lines[name] = now

    def extend(self, start: Point3, end: Point3, color: tuple[int, int, int]) -> None:
        """Draw a line that stays."""
        self._line(start, end, color, -1)

    def _line(self, start: Point3, end: Point3, color: tuple[int, int, int], replaced: int) -> int:
        shade = [part / 255.0 for part in color]
        options = {"lineWidth": _WIDTH, "replaceItemUniqueId": replaced}
        return int(self._call("addUserDebugLine", start, end, shade, **options))

    def _configure(self, flag: str, value: int) -> None:
        self._call("configureDebugVisualizer", getattr(bullet, flag), value)

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)
