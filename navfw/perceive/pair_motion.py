"""Estimate the camera's motion between two images: rotation, heading and metric scale.

Rotation and heading are estimated from tracked points (``navfw.egomotion.flow_egomotion``), corners
at the resolution of the original: their positions are more exact than flow on a grid of small
images, and pyramids follow rotations that exceed its search range. A gyro is the prior of the
rotation; without one the rate of the pair before is, as exactly as rates have been steady: it
decides if few points are tracked. The heading of earlier pairs is a weak prior: it decides between
the two motions that explain the image of a single plane.

Flow gives distances as multiples of the baseline. If the floor is visible, it gives the camera's
height as a multiple of the baseline, too. A known speed thus yields the height, and a known height
the speed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from navfw.camera_geometry import rotations
from navfw.camera_geometry.rotations import rotate_points
from navfw.egomotion.flow_egomotion import (
    FREE_TURN,
    Egomotion,
    EgomotionPrior,
    MotionKind,
    PointMotion,
    estimate_egomotion,
)
from navfw.egomotion.plane_approach import towards_plane
from navfw.numerics import Array, Image
from navfw.perceive.motion_record import RATES, MotionRecord
from navfw.perceive.perceiver_options import WorkingSize
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

_NOMINAL_SPEED = 0.35
"""Speed assumed if the scale is unknown [m/s]: the limits of OFFIS's distance terms in metres,
divided by this speed, are those of its terms of time to contact in seconds."""
NO_FLOOR = 50.0
"""Camera height [m] if no floor is visible: all cells below the horizon then count as objects."""


@dataclass(frozen=True, slots=True)
class Scale:
    """The ``speed`` [m/s] and camera ``height`` [m] that OFFIS uses.

    ``source`` is "speed" if the speed was given, "height" if the speed follows from a given height
    and the floor, and "none" if the scale is unknown: only ratios of distances are then meaningful.
    """

    speed: float
    height: float
    source: str

    @property
    def metric(self) -> bool:
        """Whether distances are in metres; else only their ratios are meaningful."""
        return self.source != "none"

    @property
    def floor(self) -> bool:
        """Whether the height above the floor is known."""
        return self.height < NO_FLOOR


@dataclass
class ScaleEstimator:
    """Estimates unknown ``speed`` [m/s] or ``height`` [m] from the floor of recent images."""

    speed: float | None
    height: float | None
    _ratios: deque[float] = field(default_factory=lambda: deque(maxlen=31))

    def update(self, ratio: float | None) -> Scale:
        """Return the scale after a measured ``ratio`` [1/s], speed / height; None: no floor."""
        if ratio is not None:
            self._ratios.append(ratio)
        usual = float(np.median(self._ratios)) if self._ratios else None
        if self.speed is not None:
            height = self.height or (NO_FLOOR if usual is None else self.speed / usual)
            return Scale(self.speed, min(max(height, 0.05), NO_FLOOR), "speed")
        now = ratio or usual
        if now is None:
            return Scale(_NOMINAL_SPEED, NO_FLOOR, "none")
        if self.height is not None:
            return Scale(self.height * now, self.height, "height")
        return Scale(_NOMINAL_SPEED, min(max(_NOMINAL_SPEED / now, 0.05), NO_FLOOR), "none")


MAX_WIDTH = 640
"""Largest width of the images in which points are tracked [px]."""

POINTS = 400
"""Largest number of points."""

QUALITY = 0.005
"""Least eigenvalue of a corner's structure tensor, relative to the best corner's."""

WINDOW = 21
"""Side [px] of the window of a point in images as wide as MAX_WIDTH; at least _MIN_WINDOW."""
_MIN_WINDOW = 11

_LEVELS = 4
"""Number of levels of the pyramid."""

_RETURN = 0.5
"""Largest distance [px] between a point and the end of tracking it forth and back."""

SIGMA = 0.15
"""Standard deviation of a track [px of the track image]."""

_TRACK_OVERLAP = 2.0
"""Number of tracks that share an error."""


@dataclass(frozen=True, slots=True)
class TrackImage:
    """A grey image (height, width) for tracking, and its ``scale`` relative to the original."""

    grey: Image
    scale: float

    @classmethod
    def of(cls, image: Image) -> TrackImage:
        """Make the track image of an original (height, width, 3)."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        scale = min(MAX_WIDTH / grey.shape[1], 1.0)
        if scale < 1.0:
            grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        return cls(np.ascontiguousarray(grey, dtype=np.uint8), scale)


def track_points(past: TrackImage, now: TrackImage, size: WorkingSize) -> PointMotion:
    """Track corners of ``now`` to ``past``; positions are in pixels of the working image."""
    # half the distance of points spread evenly
    distance = max(0.5 * float(np.sqrt(now.grey.size / POINTS)), 3.0)
    corners: Any = cv2.goodFeaturesToTrack(now.grey, POINTS, QUALITY, distance)
    if corners is None:
        none = np.empty((0, 2))
        return PointMotion(none, none, np.empty(0), np.empty(0))
    back, forth = _tracked(now.grey, past.grey, corners)
    again, back_again = _tracked(past.grey, now.grey, back)
    good = forth & back_again & (np.linalg.norm((again - corners).reshape(-1, 2), axis=1) < _RETURN)
    factor = size.scale / now.scale
    return PointMotion(
        _centred(corners.reshape(-1, 2)[good], now.grey) * factor,
        _centred(back.reshape(-1, 2)[good], past.grey) * factor,
        np.full(int(good.sum()), SIGMA * factor),
        np.full(int(good.sum()), 1.0 / _TRACK_OVERLAP),
    )


def _tracked(image: Image, other: Image, points: Any) -> tuple[Any, Any]:
    """Return where ``points`` (n, 1, 2) of ``image`` are in ``other``, and whether found (n,)."""
    side = max(WINDOW * image.shape[1] // MAX_WIDTH | 1, _MIN_WINDOW)
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        image,
        other,
        points,
        np.empty_like(points),
        winSize=(side, side),
        maxLevel=_LEVELS,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01),
    )
    return moved, np.asarray(status).ravel() > 0


def _centred(points: Array, grey: Image) -> Array:
    """Convert ``points`` (n, 2) [px, centre of the first pixel at 0] to the image's centre."""
    height, width = grey.shape
    return np.asarray(points, dtype=np.float64) - 0.5 * (np.array([width, height]) - 1.0)


_GYRO_SIGMA = 0.005
"""Standard deviation of the constant error of a gyro's rates [rad/s]."""

_HEADING_DRIFT = 0.35
"""Standard deviation of the change of heading from one pair to the next [rad]."""

_MIN_DRIFT = 0.1
"""Least such deviation after many pairs of the same heading [rad]."""

DEVIATION = 3.0
"""Deviations from the estimated motion that count as possible, in standard deviations."""

RATE_DRIFT = 0.35
"""Least standard deviation of the change of a rate of rotation from one pair to the next [rad/s]:
that of a vehicle that begins to turn."""

_RATE_SPREAD = 4.5
"""That deviation as a multiple of the median of recent changes: three standard deviations of a
normal change, since changes come suddenly."""

MEMORY = 20
"""Number of pairs whose headings and changes of rate are remembered."""

SURE_HEADING = 0.25
"""Largest standard deviation of a heading [rad] with which distances count as known."""


@dataclass(frozen=True, slots=True)
class PairMotion:
    """The ``egomotion`` between two images ``dt`` [s] apart.

    ``turn_source`` says what measured the rotation: "gyro", "poses" or "flow"; ``notes`` are
    remarks. ``to_plane`` is True if it moves towards a plane across the optical axis: no heading is
    needed.
    """

    egomotion: Egomotion
    dt: float
    turn_source: str
    notes: tuple[str, ...]
    to_plane: bool = False

    @property
    def has_heading(self) -> bool:
        """Whether the heading is known."""
        return self.egomotion.heading_sigma <= SURE_HEADING

    @property
    def translates(self) -> bool:
        """Whether distances can be known up to scale."""
        return self.has_heading or self.to_plane

    def camera_motion(self, way: float) -> CameraMotion:
        """Return the motion of a camera that travels ``way`` [m] between the images."""
        egomotion = self.egomotion
        vertical = float(egomotion.covariance[1, 1])
        return CameraMotion(
            egomotion.rotation,
            egomotion.direction * way,
            self.dt,
            math.sqrt(min(vertical, FREE_TURN**2)),
            0.1 * way,
        )

    def alternatives(self, flow: FlowField, focal: float) -> Iterator[FlowField]:
        """Yield ``flow`` (derotated) as it is by other motions that the points allow."""
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
    """Estimates the motions of the pairs of a sequence, in their order."""

    def __init__(self, camera: CameraModel, size: WorkingSize, gyro: MotionRecord | None) -> None:
        self._camera = camera
        self._size = size
        self._gyro = gyro
        self._rate: Array | None = None
        self._changes: deque[float] = deque(maxlen=MEMORY)
        self._headings: deque[Array] = deque(maxlen=MEMORY)

    def interrupt(self) -> None:
        """Forget the rate of rotation: the next pair does not follow the last one."""
        self._rate = None

    def estimate(self, past: TrackImage, now: TrackImage, begin: float, end: float) -> PairMotion:
        """Estimate the motion from ``past`` at ``begin`` [s] to ``now`` at ``end`` [s]."""
        prior, source, notes = self._prior(begin, end)
        tracks = track_points(past, now, self._size)
        egomotion, plane = estimate_egomotion(tracks, self._camera.focal, prior), None
        if egomotion.kind is MotionKind.UNKNOWN or egomotion.heading_sigma > SURE_HEADING:
            plane = towards_plane(tracks, self._camera.focal, prior)
            egomotion = plane or egomotion
        if egomotion.kind is not MotionKind.UNKNOWN:
            rate = rotation_vector(egomotion.rotation, self._camera) / (end - begin)
            if self._rate is not None:
                self._changes.append(float(np.abs(rate - self._rate).max()))
            self._rate = rate
        if egomotion.heading_sigma <= SURE_HEADING:
            self._headings.append(egomotion.direction)
        return PairMotion(egomotion, end - begin, source, notes, to_plane=plane is not None)

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
                is_measured = np.array([name in self._gyro.measured for name in reversed(RATES)])
                turn = np.where(is_measured, measured, turn)
                sigma = np.where(is_measured, _GYRO_SIGMA * (end - begin), sigma)
        base = self._camera.base_from_camera
        prior = EgomotionPrior(
            base.T @ rotations.rotation_matrix(-turn) @ base, base.T @ np.diag(sigma**2) @ base
        )
        heading = self._usual_heading()
        if heading is not None:
            prior = replace(prior, direction=heading[0], direction_sigma=heading[1])
        return prior, source, notes

    def _usual_heading(self) -> tuple[Array, float] | None:
        """Return the mean of recent headings and their spread [rad]; None without any."""
        if not self._headings:
            return None
        directions = np.array(self._headings)
        mean = np.median(directions, axis=0)
        mean /= max(float(np.linalg.norm(mean)), 1e-9)
        off = np.arccos(np.clip(directions @ mean, -1.0, 1.0))
        spread = 1.2 * float(np.median(off))
        return mean, max(spread, _HEADING_DRIFT / math.sqrt(len(directions)), _MIN_DRIFT)


def rotation_vector(rotation: Array, camera: CameraModel) -> Array:
    """Convert ``rotation`` (3, 3), past to current camera, to base_link's x, y, z (3,) [rad]."""
    base = camera.base_from_camera
    turn = np.ascontiguousarray(base @ rotation.T @ base.T)
    return np.asarray(rotations.rotation_vector(turn))
