"""Sensor models of gyro and wheel encoders: bias random walk, noise, slip, quantisation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import Field

from navfw.errors import UnknownNameError
from navfw.robot import OdometrySheet, RobotModel
from navfw.signals import Encoders, Inertial


class SensorParams(OdometrySheet):
    """Parameters of the sensor models; the defaults are those of an inexpensive robot.

    The robot knows those of the ``OdometrySheet``, as from a data sheet.
    """

    image_noise: float = Field(
        2.0, ge=0.0, le=40.0, description="image noise, standard deviation [grey levels]"
    )
    supersample: int = Field(
        1, ge=1, le=4, description="render at this multiple of the size and average"
    )
    gyro_bias: float = Field(
        math.radians(0.05),
        ge=0.0,
        le=1.0,
        description="standard deviation of the bias at power-on [rad/s]",
    )
    radius_mismatch: float = Field(
        0.01, ge=0.0, le=0.5, description="difference of the wheels' radii, share of the radius"
    )

    @classmethod
    def preset(cls, name: str, **changes: Any) -> SensorParams:
        """Make the parameters of a preset, with single values changed.

        Raises:
            UnknownNameError: no preset has that name.

        """
        if name not in PRESETS:
            raise UnknownNameError("sensor preset", name, PRESETS)
        return cls(**{**PRESETS[name], **changes})

    @property
    def sheet(self) -> OdometrySheet:
        """The part of the parameters that the robot knows as its data sheet."""
        return OdometrySheet(**{name: getattr(self, name) for name in OdometrySheet.model_fields})


PRESETS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "perfect": {
            "image_noise": 0.0,
            "gyro_bias": 0.0,
            "gyro_bias_walk": 0.0,
            "gyro_noise": 0.0,
            "slip": 0.0,
            "slip_mean": 0.0,
            "radius_mismatch": 0.0,
        },
        "good": {
            "image_noise": 1.0,
            "gyro_bias": math.radians(0.01),
            "gyro_bias_walk": math.radians(0.001),
            "gyro_noise": math.radians(0.03),
            "slip": 0.005,
            "slip_mean": 0.001,
            "radius_mismatch": 0.002,
        },
        "default": {},
        "poor": {
            "image_noise": 5.0,
            "gyro_bias": math.radians(0.3),
            "gyro_bias_walk": math.radians(0.02),
            "gyro_noise": math.radians(0.3),
            "slip": 0.05,
            "slip_mean": 0.015,
            "radius_mismatch": 0.02,
        },
    }
)
"""By name, the values of presets that differ from the defaults."""


class GyroModel:
    """A three-axis rate gyro: bias with random walk, and white noise, on every axis.

    The yaw rate is the mean since the last reading, as from an integrating gyro.
    """

    def __init__(self, params: SensorParams, rng: np.random.Generator) -> None:
        self._params, self._rng = params, rng
        self._bias: list[float] = (params.gyro_bias * rng.standard_normal(3)).tolist()

    def read(self, time: float, dt: float, rates: tuple[float, float, float]) -> Inertial:
        """Measure the true ``rates`` (roll, pitch, yaw) [rad/s], ``dt`` [s] after the last call."""
        drawn = self._rng.standard_normal(6).tolist()
        walk, noise = self._params.gyro_bias_walk * math.sqrt(dt), self._params.gyro_noise
        bias = self._bias
        for axis in range(3):
            bias[axis] += walk * drawn[axis]
        roll, pitch, yaw = [rates[axis] + bias[axis] + noise * drawn[3 + axis] for axis in range(3)]
        return Inertial(time, roll, pitch, yaw)


class WheelEncoderModel:
    """Incremental encoders on both wheels, with slip: a wheel turns farther than the robot moves.

    Each wheel's slip, a share of its distance, is a first-order Gauss-Markov process with the time
    constant ``slip_time``. The wheels' radii differ by ``radius_mismatch``; which one is larger is
    drawn once. ``more_slip`` is added while the floor is slippery.
    """

    def __init__(self, params: SensorParams, robot: RobotModel, rng: np.random.Generator) -> None:
        self._params, self._rng = params, rng
        self._ticks_per_radian = robot.ticks_per_turn / (2.0 * math.pi)
        half = 0.5 * params.radius_mismatch * float(rng.choice((-1.0, 1.0)))
        self._scale = (1.0 - half, 1.0 + half)
        self._slip: list[float] = (params.slip * rng.standard_normal(2)).tolist()
        self._turned = [0.0, 0.0]
        self._last = (0.0, 0.0)
        self.more_slip = 0.0

    def reset(self, angles: tuple[float, float]) -> None:
        """Set the counters' origin to the wheel angles (left, right) [rad]."""
        self._last = angles

    def read(self, time: float, dt: float, angles: tuple[float, float]) -> Encoders:
        """Count the ticks at wheel angles (left, right) [rad], ``dt`` [s] after the last call."""
        keep = math.exp(-dt / self._params.slip_time) if self._params.slip_time > 0.0 else 0.0
        spread = self._params.slip * math.sqrt(1.0 - keep * keep)
        drawn = self._rng.standard_normal(2).tolist()
        usual = 1.0 + self._params.slip_mean + self.more_slip
        for side in range(2):
            self._slip[side] = keep * self._slip[side] + spread * drawn[side]
            way = (angles[side] - self._last[side]) * self._scale[side]
            self._turned[side] += way * (usual + self._slip[side])
        self._last = angles
        # an encoder reports the last tick passed
        left, right = [math.floor(t * self._ticks_per_radian + 1e-9) for t in self._turned]
        return Encoders(time, left, right)
