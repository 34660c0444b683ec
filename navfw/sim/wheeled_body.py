"""A robot's body in one PyBullet client: what all bodies on motor-driven wheels share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from navfw.numerics.products import product
from navfw.signals import Array
from navfw.sim.engine import bullet

BodyState = tuple[tuple[float, float, float], tuple[float, float, float, float]]
"""Position [m] and orientation (quaternion x, y, z, w) of base_link in the map."""

ContactPoint = tuple[int, float, float, float]
"""PyBullet's id of the body in contact with the robot, and the point (x, y, z) [m]."""


class WheeledBody(ABC):
    """Wheel motors, and the true state and contacts, of the robot that ``body`` is the id of.

    Subclasses load the body, then call ``_bind``. ``_supports`` (n, 2) [m] are the points of
    base_link that rest on the floor.
    """

    body: int
    _supports: Array

    def __init__(self, client: int) -> None:
        self._client = client

    def _bind(self, wheels: Sequence[int], torque: float, **contacts: int) -> None:
        """Bind the arguments of calls of every tick or physics step once.

        ``wheels`` are the joints driven with at most ``torque`` [N m] each; ``contacts`` restrict
        the contact points.
        """
        at = {"physicsClientId": self._client}
        self._contact_points = partial(bullet.getContactPoints, self.body, **contacts, **at)
        self._base_pose = partial(bullet.getBasePositionAndOrientation, self.body, **at)
        self._base_velocity = partial(bullet.getBaseVelocity, self.body, **at)
        self._wheel_states = partial(bullet.getJointStates, self.body, wheels, **at)
        self._set_motors = partial(
            bullet.setJointMotorControlArray,
            self.body,
            wheels,
            bullet.VELOCITY_CONTROL,
            forces=[torque] * len(wheels),
            **at,
        )

    @abstractmethod
    def set_wheel_speeds(self, left: float, right: float) -> None:
        """Set the motors' target angular speeds [rad/s] of each side, forward positive."""

    @abstractmethod
    def wheel_angles(self) -> tuple[float, float]:
        """Accumulated angles of the wheels of each side (left, right) [rad]."""

    @abstractmethod
    def state(self) -> BodyState:
        """The true pose of ``base_link``."""

    def support_points(self) -> Array:
        """(n, 3) points [m] in the map: where the body rests on the floor."""
        origin, turn = self.state()
        axes = np.array(self._call("getMatrixFromQuaternion", turn)).reshape(3, 3)
        points: Array = origin + product(self._supports, axes[:, :2].T)
        return points

    def roll_pitch_rates(self, turn: tuple[float, float, float, float]) -> tuple[float, float]:
        """Angular velocity [rad/s] about the body's x and y axes; ``turn`` is its orientation."""
        wx, wy, wz = self._base_velocity()[1]
        x, y, z, w = turn
        roll = (1 - 2 * (y * y + z * z)) * wx + 2 * (x * y + w * z) * wy + 2 * (x * z - w * y) * wz
        pitch = 2 * (x * y - w * z) * wx + (1 - 2 * (x * x + z * z)) * wy + 2 * (y * z + w * x) * wz
        return roll, pitch

    def contacts(self) -> set[ContactPoint]:
        """The current contact points that count as collisions."""
        # close pairs without contact are listed too: index 8 is the distance, 9 the normal force
        return {
            (point[2], *point[6])
            for point in self._contact_points()
            if self._collides(point[2]) and (point[8] <= 1e-4 or point[9] > 0.0)
        }

    def _collides(self, other: int) -> bool:
        """Whether contact with the body of that id is a collision."""
        del other
        return True

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)
