"""Views of a painted floor, also by a body that leans, for the tests of odometry by the floor."""

import math
from dataclasses import dataclass

import numpy as np
from flow_scene import Board, board_image

from navfw.numerics import Image
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose

ROBOT = RobotModel()
ORIGIN = Pose(0.0, 0.0, 0.0)
KNOWN = np.diag([3e-3, 1e-3, 2e-3]) ** 2
"""Covariance (3, 3) of the guess of a motion."""


@dataclass
class PaintedFloor:
    """Noisy views of a textured floor, and of a wall across the x axis if there is one."""

    seed: int = 0
    contrast: float = 1.0
    wall: float = math.inf
    camera: CameraModel = ROBOT.camera

    def __post_init__(self) -> None:
        self.noise = np.random.default_rng(self.seed)

    def view(self, pose: Pose, light: float = 1.0, pitch: float = 0.0) -> Image:
        """The image that the camera of a robot at ``pose`` takes; the wall is at x = ``wall``.

        The body leans by ``pitch`` [rad], nose down, about the axle of its wheels.
        """
        c, s = math.cos(pitch), math.sin(pitch)
        ahead, above = self.camera.mount_forward, self.camera.mount_height - ROBOT.wheel_radius
        leaning = {
            "mount_forward": c * ahead + s * above,
            "mount_height": ROBOT.wheel_radius + c * above - s * ahead,
            "pitch": self.camera.pitch + pitch,
        }
        camera = self.camera.model_copy(update=leaning)
        wall = Board(self.wall, 0.0, width=100.0, height=100.0)
        image = board_image(camera, pose, boards=(wall,) if math.isfinite(wall.x) else ())
        grey = light * (128.0 + self.contrast * (image - 128.0))
        grey += self.noise.normal(0.0, 2.0, grey.shape)
        return np.asarray(np.clip(grey, 0, 255), dtype=np.uint8)
