"""Rendered images of a textured floor with upright boards, static or moving."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from navfw.numerics import Array, Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, Odometry, Pose, Twist

TEXEL = 0.02
"""Side of a texel [m]."""


@dataclass(frozen=True)
class Board:
    """An upright board across odom's x axis: place, width, height [m], velocity [m/s]."""

    x: float
    y: float
    width: float = 0.4
    height: float = 1.2
    vx: float = 0.0
    vy: float = 0.0

    def at(self, time: float) -> tuple[float, float]:
        """Centre (x, y) [m] at ``time`` [s]."""
        return self.x + self.vx * time, self.y + self.vy * time


@cache
def texture(seed: int) -> Image:
    """A (600, 600) image of smooth noise."""
    noise = np.random.default_rng(seed).random((600, 600)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    low, high = float(smooth.min()), float(smooth.max())
    return np.asarray(20 + 215 * (smooth - low) / (high - low), dtype=np.uint8)


def _sampled(seed: int, u: Array, v: Array) -> Array:
    """The texture at (u, v) [m]."""
    x, y = ((value / TEXEL + 300).astype(np.float32) for value in (u, v))
    return np.asarray(
        cv2.remap(texture(seed), x, y, cv2.INTER_LINEAR, None, cv2.BORDER_WRAP), dtype=np.float64
    )


def render(camera: CameraModel, pose: Pose, time: float, boards: tuple[Board, ...]) -> Image:
    """The image of ``camera`` on a robot at odom ``pose``."""
    y, x = np.mgrid[: camera.height, : camera.width].astype(float)
    focal = camera.focal
    rays = np.stack(
        [
            (x - 0.5 * (camera.width - 1)) / focal,
            (y - 0.5 * (camera.height - 1)) / focal,
            np.ones_like(x),
        ],
        axis=-1,
    )
    base = rays @ camera.base_from_camera.T
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    east, north = c * base[..., 0] - s * base[..., 1], s * base[..., 0] + c * base[..., 1]
    up = base[..., 2]
    eye_x, eye_y = pose.to_parent(camera.mount_forward, 0.0)
    depth = camera.mount_height / np.maximum(-up, 1e-6)
    near = depth < 40.0
    floor = np.minimum(depth, 40.0)
    image = np.where(near, _sampled(0, eye_x + floor * east, eye_y + floor * north), 128.0)
    depth = np.where(near, depth, np.inf)
    for number, board in enumerate(boards):
        at_x, at_y = board.at(time)
        along = (at_x - eye_x) / np.where(np.abs(east) < 1e-9, 1e-9, east)
        aside = eye_y + along * north - at_y
        height = camera.mount_height + along * up
        hit = (along > 0.0) & (along < depth) & (np.abs(aside) < 0.5 * board.width)
        hit &= (height > 0.0) & (height < board.height)
        image = np.where(hit, _sampled(1 + number, aside, height), image)
        depth = np.where(hit, along, depth)
    return np.asarray(np.clip(image, 0, 255), dtype=np.uint8)


def frame_at(
    robot: RobotModel, time: float, twist: Twist, boards: tuple[Board, ...]
) -> tuple[Frame, Odometry]:
    """Frame and odometry at ``time`` [s] of a robot that drives ``twist`` from the origin."""
    pose = Pose(0.0, 0.0, 0.0)
    if twist.w:
        turn, radius = twist.w * time, twist.v / twist.w
        pose = Pose(radius * float(np.sin(turn)), radius * float(1.0 - np.cos(turn)), turn)
    else:
        pose = Pose(twist.v * time, 0.0, 0.0)
    ahead, *sides = (
        render(camera, pose, time, boards) for camera in (robot.camera, *robot.side_cameras)
    )
    return Frame(time, ahead, tuple(sides)), Odometry(time, pose, twist, 0.0, still=False)
