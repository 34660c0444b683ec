"""Pitch of a body that rocks on its wheels' axle, by the gyro's roll and pitch rates.

The axle keeps the roll near zero. The pitch rate gives changes of the pitch; in a turn the roll
rate shows the pitch itself, since the axis about which the body turns is then not its own z axis.
Between turns a pitch that lasts is forgotten, so that errors of the bias do not accumulate.
"""

from __future__ import annotations

import math

from navfw.signals import Inertial

_MEMORY = 15.0
"""Time constant after which a pitch that lasts counts as level [s]."""

_BIAS_TIME = 30.0
"""Time [s] that sets how fast it counts as bias of the pitch rate: by 1 / _BIAS_TIME^2."""

_TURN_GAIN = 2.0
"""Rate [1/s] at which the pitch follows the roll rate in a turn, per squared rate of turning."""

_REST_MEMORY, _SETTLED = 10.0, 2.0
"""Time over which biases are averaged at rest, and after which they are known [s]."""

_MAX_REST_RATE = 0.02
"""Largest rate [rad/s] beside the bias that is averaged: a body may rock on its wheels at rest."""

_SWING, _NOTICED = 2.0, math.radians(0.4)
"""Time [s] within which a body rocks, and the least change in it [rad] that counts as rocking:
0.5 px of a 160 px image, and more than the bias feigns."""

_KEPT = 30.0
"""Time constant with which the amplitude of rocking is forgotten [s]."""

_MAX_PITCH = 0.2
"""Bound of the pitch [rad]: a body that leans further has fallen, or the rates are wrong."""


class RockingFilter:
    """Integrates the pitch rate.

    ``pitch`` [rad] is nose down, ``rocking`` [rad] the amplitude of the last half minute; both are
    0 of a body that does not rock.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Level, without bias."""
        self.pitch = self.rocking = 0.0
        self._pitch = self._swing = 0.0
        self._biases = [0.0, 0.0]
        self._rested = 0.0
        self._amplitude = 0.0

    def update(self, inertial: Inertial, turning: float, dt: float, still: bool) -> None:
        """Take in the mean rates of the last ``dt`` [s].

        ``turning`` [rad/s] is the yaw rate; ``still`` tells whether the wheels rest. Rates that are
        not finite, of a gyro with one axis, leave the pitch as it is.
        """
        rates = (inertial.roll_rate, inertial.pitch_rate)
        if not all(map(math.isfinite, rates)):
            return
        if still:
            self._average(rates, dt)
        roll_rate, pitch_rate = rates[0] - self._biases[0], rates[1] - self._biases[1]
        shown = _TURN_GAIN * turning * turning
        follow = 1.0 / _MEMORY + shown
        pitch = self._pitch + pitch_rate * dt
        off = -_TURN_GAIN * roll_rate * turning / follow - pitch
        pitch += off * -math.expm1(-follow * dt)
        self._biases[1] -= off * dt / _BIAS_TIME**2
        self._pitch = min(max(pitch, -_MAX_PITCH), _MAX_PITCH)
        self._swing = (self._swing + pitch_rate * dt) * math.exp(-dt / _SWING)
        self._amplitude = max(self._amplitude * math.exp(-dt / _KEPT), abs(self._swing))
        rocks = self._amplitude > _NOTICED
        self.pitch, self.rocking = (self._pitch, self._amplitude) if rocks else (0.0, 0.0)

    def _average(self, rates: tuple[float, float], dt: float) -> None:
        """Average the biases at rest, from anew after a motion before they are known."""
        off = [rate - bias for rate, bias in zip(rates, self._biases, strict=True)]
        if self._rested == 0.0:
            self._biases = list(rates)
        elif max(map(abs, off)) < _MAX_REST_RATE:
            share = dt / (self._rested + dt)
            self._biases = [b + share * o for b, o in zip(self._biases, off, strict=True)]
        elif self._rested < _SETTLED:
            self._rested = 0.0
            return
        self._rested = min(self._rested + dt, _REST_MEMORY)
