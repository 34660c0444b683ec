"""Low things, from 2 cm on, seen against the floor's motion at full image resolution.

While the camera moves on, the point of the floor that a thing of height h hides moves along by the
share h / (H - h) of the camera's way, H being its height ("plane plus parallax", Sawhney 1994). At
braking distance that shows, but only over a baseline longer than the flow's. So each piece of the
floor ahead is compared with an earlier image: as floor, and as something that moves along.
"""

from __future__ import annotations

import math
from collections import deque

import cv2
import numba
import numpy as np

from navfw.egomotion.pairing import PairingParams, PosedFrame
from navfw.numerics import Array
from navfw.numerics.arrays import Bytes
from navfw.numerics.functions import log
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Frame, FramePair, Odometry

_BASELINE, _MIN_BASELINE, _STEP = 0.9, 0.3, 0.2  # chosen
"""Baseline of a pair, desired and least, and distance between frames, in heights of the camera."""
_FRAMES, _TURN = 6, 0.25  # chosen
"""Number of frames kept, and the largest turn between those of a pair [rad]."""
_AHEAD, _REACH, _BESIDE = (1.2, 2.4, 0.07), 4.0, 0.14  # chosen
"""Points of the floor compared: ahead of the camera from, to, apart, and what the past image has to
show of it, in heights of the camera; reach beside the body's path [m]."""
_BLOCK = 3, 3  # chosen
"""Points aside and ahead that are compared together: 7 x 7 cm."""
_SHARES = np.array([0.0, 0.05, 0.085, 0.14, 0.22, 0.35])  # chosen
"""Shares compared: floor, and things 1.7 to 9.1 cm high below a camera at 0.35 m."""
_ERROR = np.array([-0.03, 0.0, 0.03])  # chosen
"""Errors of the way, as shares of it, through which a parabola finds the floor: wheels slip."""
_BLUR, _PAST_BLUR = (0.9, 1.3), 0.5  # derived
"""Smoothing of both images [px]: a pixel of the past one covers 1.5 x 2.2 of the image now."""
_NOISE, _FLOOR_NOISE = 4.0, 0.2  # chosen
"""Squared difference that says nothing: noise [grey levels^2], and the floor's mean one times."""
_LOG_RATIO, _ALIKE, _BOUNDS = 1.1, 0.2, (-0.6, 2.0)  # chosen
"""Logarithm of the squared difference as floor over that as a thing at which both are as likely;
that up to which nothing shows either; bounds of the log-odds of one pair."""


class LowThings:
    """Searches the floor ahead of a robot for things too low for the flow."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot, camera = robot, robot.camera
        self._height = height = camera.mount_height
        ahead = height * np.arange(*_AHEAD)
        side = min(robot.radius + _BESIDE, 0.9 * ahead[0] * math.tan(0.5 * camera.hfov))
        left = np.arange(-side, side, _AHEAD[2] * height)
        x, y, z = np.meshgrid(ahead, left, [-height], indexing="ij")
        rays = product(np.concatenate([x, y, z], axis=-1), camera.base_from_camera)
        middle = 0.5 * (camera.height - 1)
        shown = camera.focal * rays[:, 0, 1] < middle * rays[:, 0, 2]
        self._places, self._rays = np.concatenate([x, y], axis=-1)[shown], rays[shown]
        _, down, depth = product(np.array([_REACH, 0.0, -1.0]), camera.base_from_camera)
        self._top = min(max(int(middle + camera.focal * down / depth), 0), camera.height - 8)
        self._lens = np.array([camera.focal, 0.5 * (camera.width - 1), middle - self._top])
        self.reset()

    def reset(self) -> None:
        """Drop all frames."""
        self._frames: deque[PosedFrame] = deque(maxlen=_FRAMES)

    def search(self, frame: Frame, odometry: Odometry) -> Array | None:
        """Compare ``frame`` with an earlier one; None before the robot has driven a step ahead.

        Rows of the result (n, 3) are places ahead and left [m, base_link], and log-odds: positive
        for a low thing, negative for floor, 0 where neither shows.
        """
        now = PosedFrame.from_odometry(frame, odometry, self._robot)
        if self._frames and now.baseline(self._frames[-1]) < _STEP * self._height:
            return None
        earlier = [past for past in self._frames if now.turn(past) < _TURN]
        self._frames.append(now)
        if not (earlier and self._rays.size):
            return None
        past = min(earlier, key=lambda past: abs(now.baseline(past) - _BASELINE * self._height))
        pair = now.pair(past, self._robot, PairingParams())
        is_far = float(pair.motion.translation[2]) > _MIN_BASELINE * self._height
        return self._compared(pair) if is_far else None

    def _compared(self, pair: FramePair) -> Array:
        now, past = pair.now.image[self._top :], pair.past.image[self._top :]
        now = np.asarray(cv2.GaussianBlur(now, (5, 7), _BLUR[0], sigmaY=_BLUR[1]), np.uint8)
        past = np.asarray(cv2.GaussianBlur(past, (3, 3), _PAST_BLUR), np.uint8)
        way, rays = (
            product(what, pair.motion.rotation) for what in (pair.motion.translation, self._rays)
        )
        grey = _seen(now, self._rays, way, np.zeros(1), self._lens)

        def differences(scales: Array) -> Array:
            off: Array = grey - _seen(past, rays, way, scales, self._lens)
            return np.asarray(off - off.mean(axis=(0, 1)))

        tried = differences(1.0 + _ERROR)
        cap = _NOISE + 0.5 * float((tried[..., 1] ** 2).mean())
        less, middle, more = _means(tried, cap)
        curve = max(less - 2.0 * middle + more, 1e-6)
        scale = 1.0 + float(_ERROR[2]) * min(max(0.5 * (less - more) / curve, -1.5), 1.5)
        off = differences(scale + _SHARES)
        blocks = cv2.blur(off * off, _BLOCK) + (_NOISE + _FLOOR_NOISE * _means(off, cap)[0])
        things = blocks[..., 1:]
        ratio = log(blocks[..., 0] / things.min(axis=-1))
        evidence = np.where(np.abs(ratio) < _ALIKE, 0.0, ratio - _LOG_RATIO)
        # where the thing stands, before the floor that it hides
        share = 1.0 + _SHARES[1 + things.argmin(axis=-1)]
        places = self._places / share[..., None] + (self._robot.camera.mount_forward, 0.0)
        return np.column_stack([places.reshape(-1, 2), np.clip(evidence, *_BOUNDS).ravel()])


@numba.njit(cache=True, error_model="numpy")
def _seen(image: Bytes, rays: Array, way: Array, scales: Array, lens: Array) -> Array:
    """Grey levels (n, m, k) where ``image`` shows ``rays`` (n, m, 3) + ``scales`` (k,) x ``way``.

    ``lens`` has focal length, column and row of the principal point [px]. Beyond the border are the
    grey levels at it.
    """
    n, m, _ = rays.shape
    focal, cx, cy = lens
    seen = np.empty((n, m, scales.size))
    last, lowest = image.shape[1] - 1.001, image.shape[0] - 1.001
    for i in range(n):
        for j in range(m):
            for k in range(scales.size):
                scale = focal / max(rays[i, j, 2] + scales[k] * way[2], 1e-3)
                u = min(max(cx + scale * (rays[i, j, 0] + scales[k] * way[0]), 0.0), last)
                v = min(max(cy + scale * (rays[i, j, 1] + scales[k] * way[1]), 0.0), lowest)
                x, y = int(u), int(v)
                u, v = u - x, v - y
                above = (1.0 - u) * image[y, x] + u * image[y, x + 1]
                below = (1.0 - u) * image[y + 1, x] + u * image[y + 1, x + 1]
                seen[i, j, k] = (1.0 - v) * above + v * below
    return seen


def _means(off: Array, cap: float) -> list[float]:
    """Mean squares (k,) of ``off`` (n, m, k); those above ``cap`` count little more than it."""
    means: list[float] = (cap * off**2 / (cap + off**2)).mean(axis=(0, 1)).tolist()
    return means
