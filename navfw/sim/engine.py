"""PyBullet's clients, its window, and the display of a world's meshes in it.

PyBullet is imported without its banner, as stdout is only for results. The window's camera follows
the robot, and it closes without an error.
"""

from __future__ import annotations

import ctypes
import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np

from navfw.config.extras import extra_imports, require_extra
from navfw.errors import InputError, SimulationError
from navfw.numerics import Array, Image
from navfw.process.atomic import scratch_folder
from navfw.process.process_resources import redirected
from navfw.sim.textured_mesh import TexturedMesh


@contextmanager
def quiet_output(into: str | Path = os.devnull) -> Iterator[None]:
    """Context that discards what C code prints, or writes it to the file ``into``.

    Python's stdout cannot suppress it: file descriptors are redirected.
    """
    with Path(into).open("wb") as stream, redirected(stream.fileno(), 1, 2):
        try:
            yield
        finally:
            ctypes.CDLL(None).fflush(None)


with extra_imports("sim"), quiet_output():  # of the banner
    import pybullet
require_extra("sim", "matplotlib")  # draws the picture at the end of a run
bullet: Any = pybullet


def quaternion(yaw: float) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of a turn by ``yaw`` [rad] about the vertical axis."""
    return 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)


class BulletClient:
    """Base of the classes that use the PyBullet client with the id ``client``."""

    def __init__(self, client: int) -> None:
        self._client = client

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        """Return the answer of PyBullet's function of that name for this client."""
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)


class BulletConnection(BulletClient):
    """Opens a PyBullet client, with a window if ``gui``; close it, or use it as a context.

    Raises:
        SimulationError: PyBullet cannot be started.

    """

    def __init__(self, gui: bool = False) -> None:
        self._gui = gui
        super().__init__(-1)
        reason = "no display?" if gui else "too many simulations open?"
        try:
            with self._window_output():
                self._client = int(bullet.connect(bullet.GUI if gui else bullet.DIRECT))
        except bullet.error as error:
            reason = str(error)
        if self._client < 0:
            raise SimulationError(f"PyBullet could not be started ({reason})")

    def _window_output(self) -> AbstractContextManager[None]:
        """Discards what a window prints: all about threads and OpenGL."""
        return quiet_output() if self._gui else nullcontext()

    def close(self) -> None:
        """Disconnect from PyBullet; calling it again has no effect."""
        if self._client >= 0:
            with self._window_output():
                self._call("disconnect")
            self._client = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


# --- window and display -----------------------------------------------------------------------

Point3 = tuple[float, float, float]
"""A point x, y, z [m]."""

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
"""What the window does not show or do: empty side panels, shortcuts and picking."""
_DISTANCE, _YAW, _PITCH = 5.0, -90.0, -60.0
"""The first view of the robot: distance [m], and PyBullet's camera angles [deg]."""
_WIDTH = 3.0
"""Width of lines [px]."""
_BACKGROUND, _INK = [0.94, 0.94, 0.92], [0.1, 0.12, 0.16]
_TEXT_NEAR = 0.7
"""Position of the text on the line from the robot (0) to the camera (1)."""
_FADED, _TALL = 0.2, 0.8
"""Opacity of bodies that hide the robot, and height [m] above which a body can hide it."""
_SIGHT = 60
"""Number of points on the line from the robot to the camera that are tested against bodies."""


def check_display() -> None:
    """Check that a window can be opened; without a display PyBullet would end the process silently.

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


class SimulatorWindow(BulletClient):
    """The window of the PyBullet client ``client``; nothing is drawn before ``show``.

    Positions are (x, y, z) [m] in ``map``, colours (red, green, blue) from 0 to 255.
    """

    def __init__(self, client: int) -> None:
        super().__init__(client)
        self._lines: dict[str, list[int]] = {}
        self._said, self._text_at = -1, [0.0, 0.0, 1.0]
        self.display = Display(client)
        self._call("configureDebugVisualizer", rgbBackground=_BACKGROUND)
        for flag in (*_OFF, "COV_ENABLE_RENDERING"):
            self._configure(flag, 0)

    def show(self, x: float, y: float) -> None:
        """Begin to draw, with the camera above (x, y) [m]."""
        self._call("resetDebugVisualizerCamera", _DISTANCE, _YAW, _PITCH, [x, y, 0.0])
        self._configure("COV_ENABLE_RENDERING", 1)

    def follow(self, x: float, y: float) -> None:
        """Move the camera to (x, y) [m]; it keeps the distance and angles set by the user."""
        view = self._call("getDebugVisualizerCamera")
        forward, (yaw, pitch, distance, _) = np.array(view[5]), view[8:]
        self._call("resetDebugVisualizerCamera", distance, yaw, pitch, [x, y, 0.0])
        robot, eye = np.array([x, y, 0.1]), np.array([x, y, 0.0]) - distance * forward
        self.display.fade(robot, eye)
        self._text_at = (robot + _TEXT_NEAR * (eye - robot)).tolist()

    def say(self, text: str) -> None:
        """Write a line beside the robot, in front of everything; it replaces the last one."""
        look = {"textColorRGB": _INK, "textSize": 1.1, "replaceItemUniqueId": self._said}
        self._said = int(self._call("addUserDebugText", f"      {text}", self._text_at, **look))

    def draw(self, name: str, points: Sequence[Point3], color: tuple[int, int, int]) -> None:
        """Draw a line through ``points`` in place of the last one of this ``name``; RGB to 255."""
        before = self._lines.get(name, [])
        now = []
        for number, ends in enumerate(pairwise(points)):
            replaced = before[number] if number < len(before) else -1
            now.append(self._line(*ends, color, replaced))
        for item in before[len(now) :]:
            self._call("removeUserDebugItem", item)
        self._lines[name] = now

    def extend(self, start: Point3, end: Point3, color: tuple[int, int, int]) -> None:
        """Draw a permanent line from ``start`` to ``end``; ``color`` is RGB, 0 to 255."""
        self._line(start, end, color, -1)

    def _line(self, start: Point3, end: Point3, color: tuple[int, int, int], replaced: int) -> int:
        shade = [level / 255.0 for level in color]
        options = {"lineWidth": _WIDTH, "replaceItemUniqueId": replaced}
        return int(self._call("addUserDebugLine", start, end, shade, **options))

    def _configure(self, flag: str, value: int) -> None:
        self._call("configureDebugVisualizer", getattr(bullet, flag), value)


class Display(BulletClient):
    """Textured bodies without mass or collision shape in one PyBullet client."""

    def __init__(self, client: int) -> None:
        super().__init__(client)
        self._textures: dict[int, int] = {}
        self._faded: set[int] = set()
        self._tall: dict[int, tuple[Array, Array]] = {}

    def add(self, mesh: TexturedMesh, image: Image) -> int:
        """Add a body with a texture (height, width, 3), RGB; return its PyBullet id."""
        visual = self._call(
            "createVisualShape",
            bullet.GEOM_MESH,
            specularColor=[0.0, 0.0, 0.0],
            **mesh.arguments,
        )
        body = int(self._call("createMultiBody", 0.0, -1, visual))
        self._call("changeVisualShape", body, -1, textureUniqueId=self._texture(image))
        points = np.array(mesh.vertices).reshape(-1, 3)
        if len(points) and points[:, 2].max() > _TALL:
            self._tall[body] = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
        return body

    def place(self, body: int, position: Sequence[float], turn: Sequence[float]) -> None:
        """Set a body's position [m] and orientation (x, y, z, w) in ``map``."""
        self._call("resetBasePositionAndOrientation", body, position, turn)

    def remove(self, body: int) -> None:
        """Remove a body."""
        self._call("removeBody", body)
        self._tall.pop(body, None)
        self._faded.discard(body)

    def fade(self, target: Array, eye: Array) -> None:
        """Make tall bodies between ``eye`` and ``target`` (3,) [m] translucent, others opaque."""
        sight = np.linspace(target, eye, _SIGHT)
        faded = {
            body
            for body, (low, high) in self._tall.items()
            if ((sight > low) & (sight < high)).all(axis=1).any()
        }
        for body in faded ^ self._faded:
            colour = [1.0, 1.0, 1.0, _FADED if body in faded else 1.0]
            self._call("changeVisualShape", body, -1, rgbaColor=colour)
        self._faded = faded

    def _texture(self, image: Image) -> int:
        """PyBullet's id of a texture; PyBullet loads textures from files only."""
        if id(image) not in self._textures:
            with scratch_folder("textures") as folder:
                # uncompressed: ten times as fast as PNG
                path = folder / "texture.bmp"
                cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
                self._textures[id(image)] = int(self._call("loadTexture", str(path)))
        return self._textures[id(image)]
