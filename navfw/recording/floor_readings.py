"""Replace missing wheels or a missing gyro in a recording by the motion of the floor in images.

The camera's height gives the scale. From key image to image the motion over the floor is registered
as ``FloorOdometry`` does it, but without wheels as a prior, or without a gyro.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from navfw.camera_geometry.image_reduction import reduce_frame
from navfw.egomotion.floor_registration import FloorImage, FloorRegistration
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Encoders, Frame, Pose, SensorReading
from navfw.stack.continuity import GAP, shows
from navfw.stack.vision import straight_reading

_KEY = 0.12, math.radians(8.0)  # chosen
"""Distance [m] and turn [rad] at which an image becomes the next key image, as in
``FloorOdometry``."""

_DRIVEN_SIGMA, _TURNED_SIGMA = (0.02, 0.03), (0.01, 0.03)  # chosen
"""Standard deviations of the expected motion since the last image, distance [m] and turn [rad]: if
wheels and gyro measured it, and if the last speed is kept."""

_ASIDE_SIGMA = 0.005  # chosen
"""Standard deviation of the motion to the side [m]: wheels do not slide."""

_GATE = 3.0  # chosen
"""Deviation [sigma] from the expected motion above which a registration is discarded."""

_CLEAR = 0.85, 0.92  # measured
"""Least share of agreeing pixels, and of the variance that they explain, of an image that shows the
floor. In three drives they were 0.87 and 0.94 at least; walls in view explained 0.90 at most."""

_REST = np.array([3e-4, 1e-3])  # measured
"""Motion [m, rad] below which the robot stands still: the noise of two images is less."""

_HERE = Pose(0.0, 0.0, 0.0)


def with_floor_motion(
    readings: Sequence[SensorReading], robot: RobotModel, missing: Collection[str]
) -> tuple[list[SensorReading], float]:
    """Return ``readings`` with the floor's motion in place of the sensors ``missing``.

    ``missing`` holds "wheels", "gyro", or both. The second value is the share (0 to 1) of images in
    which the motion was found. Without wheels, readings are left out around which it was not found
    for longer than the ``GAP`` at which drives are split.
    """
    times = np.array([reading.time for reading in readings])
    lens = robot.camera.undistortion()
    frames = [frame for r in readings if (frame := straight_reading(r, lens).frame) is not None]
    at = np.array([frame.time for frame in frames])
    totals = _measured(readings, robot, missing)
    known = np.stack([np.interp(at, times, total) for total in totals])
    expected = np.diff(known, axis=1, prepend=known[:, :1]).T
    steps = _floor_steps(frames, expected, robot, missing)
    seen = steps[:, 2] > 0.0
    way, yaw = (np.interp(times, at, np.cumsum(steps[:, k])) for k in (0, 1))
    per_way = robot.ticks_per_turn / (2.0 * math.pi * robot.wheel_radius)
    apart = 0.5 * robot.track * yaw
    ticks = np.rint(per_way * np.column_stack([way - apart, way + apart])).astype(int)
    rates = np.diff(yaw, prepend=0.0) / np.diff(times, prepend=-math.inf)
    after = np.searchsorted(at[seen], times - 1e-6)
    ends = np.concatenate([[-math.inf], at[seen], [math.inf]])
    kept = (ends[after + 1] - ends[after] <= GAP) | ("wheels" not in missing)
    made = list[SensorReading]()
    for i in np.flatnonzero(kept).tolist():
        reading, now = readings[i], readings[i].time
        if "wheels" in missing:
            reading = replace(reading, encoders=Encoders(now, *ticks[i].tolist()))
        if "gyro" in missing:
            inertial = replace(reading.inertial, time=now, yaw_rate=float(rates[i]))
            reading = replace(reading, inertial=inertial)
        made.append(reading)
    return made, float(seen.mean())


def _measured(
    readings: Sequence[SensorReading], robot: RobotModel, missing: Collection[str]
) -> Array:
    """Return distance [m] and turn [rad] up to each reading, (2, n), by the sensors; else nan."""
    per_tick = 2.0 * math.pi * robot.wheel_radius / robot.ticks_per_turn
    ticks = np.array([(r.encoders.left, r.encoders.right) for r in readings])
    rolled = np.full(ticks.shape, math.nan) if "wheels" in missing else per_tick * ticks
    turned = (rolled[:, 1] - rolled[:, 0]) / robot.track
    if "gyro" not in missing:
        rates = np.nan_to_num([reading.inertial.yaw_rate for reading in readings])
        spans = np.diff([reading.time for reading in readings], prepend=readings[0].time)
        turned = np.cumsum(rates * spans)
    return np.stack([rolled.mean(axis=1), turned])


def _floor_steps(
    frames: Sequence[Frame], expected: Array, robot: RobotModel, missing: Collection[str]
) -> Array:
    """Return (n, 3): distance [m], turn [rad] since the image before, 1 if the floor showed it.

    ``expected`` (n, 2) are the sensors' distances and turns, nan if the last speed is expected.
    """
    registration = FloorRegistration(robot.with_reduced_images())
    driven, turned = _DRIVEN_SIGMA["wheels" in missing], _TURNED_SIGMA["gyro" in missing]
    sigma = np.array([driven, _ASIDE_SIGMA, turned])
    pose, speed, steps = _HERE, np.zeros(2), list[tuple[float, ...]]()
    key: FloorImage | None = None
    spans = np.diff([frame.time for frame in frames], prepend=frames[0].time - 1.0)
    for frame, by_sensors, dt in zip(frames, expected, spans.tolist(), strict=True):
        grey = reduce_frame(frame, robot.camera.reduction).image
        image = registration.prepare(grey) if shows(grey) else None
        way, turn = np.where(np.isnan(by_sensors), speed * dt, by_sensors).tolist()
        arc = Pose(way * math.cos(0.5 * turn), way * math.sin(0.5 * turn), turn)
        guess = now = pose.compose(arc)
        seen, step = image is not None and not steps, None
        if key is not None and image is not None:
            step = registration.register(key, image, guess, np.diag(sigma**2))
        if step is not None and step.share >= _CLEAR[0] and step.explained >= _CLEAR[1]:
            off = guess.relative(step.pose)
            seen = bool((np.abs([off.x, off.y, off.yaw]) < _GATE * sigma).all())
            now = step.pose if seen else guess
        moved = pose.relative(now)
        motion = np.array([math.copysign(math.hypot(moved.x, moved.y), moved.x), moved.yaw])
        if (np.abs(motion) < _REST).all():
            motion[:], now = 0.0, pose
        steps.append((*motion.tolist(), float(seen)))
        speed, pose = motion / dt, now
        if (
            not seen
            or key is None
            or math.hypot(pose.x, pose.y) > _KEY[0]
            or abs(pose.yaw) > _KEY[1]
        ):
            key, pose = image, _HERE
    return np.array(steps)
