"""The camera's motion between two images of a sequence: tracked points, gyro, and what was before.

Rotation and heading are estimated from tracked points (``navfw.egomotion.flow_egomotion``). The
gyro, where there is one, is the prior of the rotation. Otherwise the rate of the pair before is, as
exactly as rates have been steady: it decides where few points are tracked. The heading of the pairs
before is a weak prior: it decides between the two motions that explain the image of a single plane.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from navfw.camera_geometry import rotations
from navfw.camera_geometry.rotations import rotate_points
from navfw.egomotion.flow_egomotion import (
    FREE_TURN,
    Egomotion,
    EgomotionPrior,
    MotionKind,
    estimate_egomotion,
)
from navfw.perceive.gyro_columns import RATES
from navfw.perceive.motion_record import MotionRecord
from navfw.perceive.point_tracks import TrackImage, track_points
from navfw.perceive.working_size import WorkingSize
from navfw.robot import CameraModel
from navfw.signals import Array, CameraMotion, FlowField

_GYRO_SIGMA = 0.005
"""Standard deviation of the constant error of a gyro's rates [rad/s]."""

_HEADING_DRIFT = 0.35
"""Standard deviation of the change of heading from one pair to the next [rad]."""

_MIN_DRIFT = 0.1
"""Least of it after many pairs of one heading [rad]."""

DEVIATION = 3.0
"""How far off the motion is taken to be possible, in standard deviations."""

RATE_DRIFT = 0.35
"""Least standard deviation of the change of a rate of rotation from one pair to the next [rad/s]:
that of a vehicle that begins to turn."""

_RATE_SPREAD = 4.5
"""The same as a multiple of the median of recent changes: three standard deviations of a normal
change, since changes come suddenly."""

MEMORY = 20
"""Number of pairs whose headings and changes of rate are remembered."""

_SURE_HEADING = 0.25
"""Largest standard deviation of a known heading [rad]: beyond it distances are not known."""


@dataclass(frozen=True, slots=True)
class PairMotion:
    """The ``egomotion`` between two images ``dt`` [s] apart.

    ``turn_source`` tells what measured the rotation: "gyro", "poses" or "flow"; ``notes`` are
    remarks.
    """

    egomotion: Egomotion
    dt: float
    turn_source: str
    notes: tuple[str, ...]

    @property
    def translates(self) -> bool:
        """Whether the heading is known."""
        return self.egomotion.heading_sigma <= _SURE_HEADING

    def camera_motion(self, way: float) -> CameraMotion:
        """The motion of a camera that travels ``way`` [m]."""
        found = self.egomotion
        vertical = float(found.covariance[1, 1])
        return CameraMotion(
            found.rotation,
            found.direction * way,
            self.dt,
            math.sqrt(min(vertical, FREE_TURN**2)),
            0.1 * way,
        )

    def alternatives(self, flow: FlowField, focal: float) -> Iterator[FlowField]:
        """What ``flow`` (derotated) is by other motions that the tracked points allow."""
        past = flow.points - flow.vectors
        for turn, direction in self.egomotion.deviations(DEVIATION):
            moved = replace(
                flow.motion,
                rotation=turn @ flow.motion.rotation,
                translation=direction * flow.motion.baseline,
            )
            turned = rotate_points(past, turn, focal)
            yield replace(flow, vectors=flow.points - turned, motion=moved)


class PairMotionEstimator:
    """Estimates the motions of one sequence in their order."""

    def __init__(self, camera: CameraModel, size: WorkingSize, gyro: MotionRecord | None) -> None:
        self._camera = camera
        self._size = size
        self._gyro = gyro
        self._rate: Array | None = None
        self._changes: deque[float] = deque(maxlen=MEMORY)
        self._headings: deque[Array] = deque(maxlen=MEMORY)

    def interrupt(self) -> None:
        """Forget the rate of rotation: the next pair does not follow those before."""
        self._rate = None

    def estimate(self, past: TrackImage, now: TrackImage, begin: float, end: float) -> PairMotion:
        """The motion from image ``past`` at ``begin`` [s] to image ``now`` at ``end`` [s]."""
        prior, source, notes = self._prior(begin, end)
        tracks = track_points(past, now, self._size)
        found = estimate_egomotion(tracks, self._camera.focal, prior)
        if found.kind is not MotionKind.UNKNOWN:
            rate = rotation_vector(found.rotation, self._camera) / (end - begin)
            if self._rate is not None:
                self._changes.append(float(np.abs(rate - self._rate).max()))
            self._rate = rate
        if found.heading_sigma <= _SURE_HEADING:
            self._headings.append(found.direction)
        return PairMotion(found, end - begin, source, notes)

    def _prior(self, begin: float, end: float) -> tuple[EgomotionPrior, str, tuple[str, ...]]:
        turn, sigma = np.zeros(3), np.full(3, FREE_TURN)
        if self._rate is not None:
            usual = float(np.median(self._changes)) if self._changes else math.inf
            drift = max(_RATE_SPREAD * usual, RATE_DRIFT)
            turn = self._rate * (end - begin)
            sigma = np.full(3, min(drift * (end - begin), FREE_TURN))
        source, notes = "flow", tuple[str, ...]()
        if self._gyro is not None:
            measured = self._gyro.rotation_between(begin, end)
            if measured is None:
                notes = (f"gap in the {self._gyro.source} record: rotation from the flow",)
            else:
                source = self._gyro.source
                # a rotation vector is in the order roll, pitch, yaw
                known = np.array([name in self._gyro.measured for name in reversed(RATES)])
                turn = np.where(known, measured, turn)
                sigma = np.where(known, _GYRO_SIGMA * (end - begin), sigma)
        base = self._camera.base_from_camera
        prior = EgomotionPrior(
            base.T @ rotations.rotation_matrix(-turn) @ base, base.T @ np.diag(sigma**2) @ base
        )
        heading = self._usual_heading()
        if heading is not None:
            prior = replace(prior, direction=heading[0], direction_sigma=heading[1])
        return prior, source, notes

    def _usual_heading(self) -> tuple[Array, float] | None:
        """Mean of the recent headings and their spread [rad]; None without any."""
        if not self._headings:
            return None
        directions = np.array(self._headings)
        mean = np.median(directions, axis=0)
        mean /= max(float(np.linalg.norm(mean)), 1e-9)
        off = np.arccos(np.clip(directions @ mean, -1.0, 1.0))
        spread = 1.2 * float(np.median(off))
        return mean, max(spread, _HEADING_DRIFT / math.sqrt(len(directions)), _MIN_DRIFT)


def rotation_vector(rotation: Array, camera: CameraModel) -> Array:
    """Rotation vector (3,) [rad] about base_link's x, y, z of the camera's ``rotation`` (3, 3)."""
    base = camera.base_from_camera
    turn = np.ascontiguousarray(base @ rotation.T @ base.T)
    return np.asarray(rotations.rotation_vector(turn))
