"""Multi-object tracking: moving objects in the odom frame, from detection to detection.

A detection gives a bearing, a distance by the floor, and by its vectors a velocity. Detections are
associated with tracks by a gated cost; a Kalman filter with a constant-velocity model follows each
track. A track that is not detected again in view is dropped soon, one that has left the view later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.movers.localization import BORDER_ANGLE
from navfw.numerics import Array
from navfw.numerics.linear_systems import inverse, solve
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import MovingObject, OccupiedDisc, Pose

MAX_AGE_OUT_OF_VIEW = 4.0  # chosen
"""Life of a track that has left the view [s]."""
BEARING_SIGMA = 0.06  # chosen
"""Error of a detected bearing [rad]."""
SPEED_SIGMA = 0.4  # chosen
"""Prior of the speed, one sigma per axis [m/s]."""
ACCELERATION_SIGMA = 0.5  # chosen
"""Process noise: acceleration, one sigma [m/s^2]."""
PATH_TIME = 0.6  # chosen
"""Time over which a track's path is occupied [s]."""

Positive = Annotated[float, Field(gt=0.0, le=100.0)]
"""Sigmas and speeds [m/s]: beyond 100 nothing changes any more."""

_MERGE_DISTANCE, _TURNED_DISTANCE = 0.3, 0.5  # chosen
"""Tracks nearer to each other than this [m] are one object: people keep farther apart. A new one
within the second of an old one is the same, which turned suddenly."""
_MAX_AGE, _OVERLAP = 0.25, 0.03  # chosen
"""A track not updated for the first [s] whose predicted place overlaps the robot by more than the
second [m] is dropped: the object has gone elsewhere."""
_GATE_DISTANCE = 0.8  # chosen
"""Largest distance [m] between a detection and the predicted place of its track. The covariance of
an old track by itself would admit detections from anywhere."""
_VELOCITY_SIGMA = 0.2  # chosen
"""Change of velocity [m/s] that costs as much in association as one sigma of position."""
_OWN_PLACE = 0.5  # chosen
"""Distance [m] within which occupied cells may be those of the tracked object itself."""
_MAX_CHANGE = 0.45  # chosen
"""Largest change of velocity [m/s] between the detections that confirm a track: mismatches on a
static object show another velocity in each frame."""
_SHAPE_SIGMA = 0.06  # chosen
"""Error of a position [m] because the body is no disc and is seen in part from near."""
_MAX_RANGE = 2.0  # chosen
"""Distance [m] up to which a moving object in view is expected to be detected."""


class TrackerParams(StrictModel):
    """Association, motion model and life time of tracks."""

    max_age_in_view: float = Field(
        1.0, gt=0.0, le=30.0, description="life of a track not detected again in view [s]"
    )
    gate: Positive = Field(
        3.0, description="largest distance of a detection from its track [sigma]"
    )
    distance_sigma: Positive = Field(0.2, description="error of a detected distance, relative [1]")
    min_hits: int = Field(2, ge=1, le=50, description="detections from which a track is confirmed")
    max_speed: Positive = Field(1.0, description="speed to which tracks are clipped [m/s]")
    radius: tuple[Positive, Positive] = Field(
        (0.22, 0.35), description="least and largest radius of an object [m]"
    )


@dataclass(slots=True, eq=False)
class Track:
    """A moving object as a disc: ``state`` (x, y, vx, vy) [m, m/s] in odom at ``time`` [s].

    ``covariance`` (4, 4) is of the state, ``radius`` [m] of the disc; ``hits`` counts detections.
    """

    state: Array
    covariance: Array
    radius: float
    time: float
    hits: int = 1

    def predict(self, time: float) -> tuple[float, float]:
        """Predict the position (x, y) [m] in odom at ``time`` [s]."""
        dt = time - self.time
        x, y, vx, vy = self.state.tolist()
        return x + vx * dt, y + vy * dt

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity (vx, vy) [m/s] in odom."""
        return float(self.state[2]), float(self.state[3])


@dataclass(frozen=True, slots=True)
class _Measurement:
    """A detection in odom: position with information (2, 2); information and evidence of velocity.

    ``velocity`` (2,) [m/s] is the velocity's estimate under the prior of the speed.
    """

    time: float
    position: Array
    position_information: Array
    velocity_information: Array
    velocity_evidence: Array
    velocity: Array
    radius: float


class Tracker:
    """Associates detections with tracks in odom, and keeps the tracks of the last seconds."""

    def __init__(self, robot: RobotModel, params: TrackerParams | None = None) -> None:
        self.params = params or TrackerParams()
        camera = self._camera = robot.camera
        self._half_view = robot.seen_aside
        self._radius = robot.radius
        lowest = math.atan(0.5 * camera.height / camera.focal) + camera.pitch
        # nearer than this the foot point is below the image
        self._reach = (
            camera.mount_height / math.tan(lowest) if lowest > 0.0 else math.inf,
            _MAX_RANGE,
        )
        self.reset()

    def reset(self) -> None:
        """Drop all tracks."""
        self.tracks: list[Track] = []

    def update(self, detections: Iterable[MovingObject], pose: Pose) -> None:
        """Associate ``detections``, seen from odom ``pose``, with tracks; begin missing tracks."""
        measurements = [self._measure(detection, pose) for detection in detections]
        associated = self._associate(measurements)
        for index, measurement in enumerate(measurements):
            if index in associated:
                self._correct(associated[index], measurement)
            else:
                associated[index] = self._begin(measurement)
                self.tracks.append(associated[index])
        for track in associated.values():
            self._merge_into(track, _TURNED_DISTANCE if track.hits == 1 else _MERGE_DISTANCE)

    def _associate(self, measurements: Sequence[_Measurement]) -> dict[int, Track]:
        """Find the track of each measurement, by its index: greedy, least cost first."""
        costs = [
            (self._association_cost(track, measurement), index, number)
            for index, measurement in enumerate(measurements)
            for number, track in enumerate(self.tracks)
        ]
        associated: dict[int, Track] = {}
        for cost, index, number in sorted(costs):
            track = self.tracks[number]
            if cost == math.inf:
                break
            if index not in associated and track not in associated.values():
                associated[index] = track
        return associated

    def _merge_into(self, track: Track, distance: float) -> None:
        """Drop older tracks within ``distance`` [m] of ``track``, which was just updated.

        They are the same object; the track takes over the largest number of hits.
        """
        position = track.predict(track.time)
        duplicates = [
            other
            for other in self.tracks
            if other.time != track.time
            and math.dist(other.predict(track.time), position) <= distance
        ]
        track.hits = max((track.hits, *(duplicate.hits for duplicate in duplicates)))
        self.tracks = [other for other in self.tracks if other not in duplicates]

    def prune(
        self, time: float, pose: Pose, occupied: Callable[[float, float], bool] = lambda x, y: False
    ) -> None:
        """Drop tracks past their life at ``time`` [s], and old ones that overlap the robot in odom.

        One that reaches an ``occupied`` place (odom x, y [m]) stands there, as before a wall.
        """
        p = self.params
        for track in self.tracks:
            place = track.predict(time)
            if math.dist(place, track.state[:2]) > _OWN_PLACE and occupied(*place):
                track.state[:] = *place, 0.0, 0.0
        self.tracks = [
            track
            for track in self.tracks
            if time - track.time
            <= (p.max_age_in_view if self._in_view(track, time, pose) else MAX_AGE_OUT_OF_VIEW)
            and self._plausible(track, time, pose)
        ]

    def _plausible(self, track: Track, time: float, pose: Pose) -> bool:
        """Return whether the track is recent or its predicted place does not overlap the robot."""
        away = math.dist(track.predict(time), (pose.x, pose.y))
        return time - track.time <= _MAX_AGE or away > self._radius + track.radius - _OVERLAP

    @property
    def confirmed(self) -> tuple[Track, ...]:
        """Tracks with at least ``min_hits`` detections, taken for real objects."""
        return tuple(track for track in self.tracks if track.hits >= self.params.min_hits)

    def occupied_discs(self, time: float) -> tuple[OccupiedDisc, ...]:
        """Return odom discs that confirmed tracks occupy from ``time`` [s] over the next 0.6 s."""
        return tuple(disc for track in self.confirmed for disc in self._path(track, time))

    def _in_view(self, track: Track, time: float, pose: Pose) -> bool:
        """Return whether the object should be detected if it is where the track predicts it."""
        ahead, left = pose.to_local(*track.predict(time))
        ahead -= self._camera.mount_forward
        near, far = self._reach
        return near <= math.hypot(ahead, left) <= far and (
            abs(math.atan2(left, ahead)) <= self._half_view - BORDER_ANGLE
        )

    def _measure(self, detection: MovingObject, pose: Pose) -> _Measurement:
        """Convert the detection to odom; its distance is that of the object's visible front."""
        p = self.params
        radius = min(max(detection.distance * math.tan(detection.width), p.radius[0]), p.radius[1])
        away = detection.distance + radius
        ahead, aside = math.cos(detection.bearing), math.sin(detection.bearing)
        position = pose.to_parent(self._camera.mount_forward + away * ahead, away * aside)
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turn = np.array([[c, -s], [s, c]])
        ray = product(turn, np.array([[ahead, -aside], [aside, ahead]]))
        spread = np.hypot(
            [p.distance_sigma * detection.distance, BEARING_SIGMA * away], _SHAPE_SIGMA
        )
        return _Measurement(
            detection.time,
            np.array(position),
            product(ray, np.diag(1.0 / spread**2), ray.T),
            product(turn, detection.information, turn.T),
            product(turn, detection.evidence),
            product(turn, np.array(detection.velocity(SPEED_SIGMA))),
            radius,
        )

    def _begin(self, measurement: _Measurement) -> Track:
        """Begin a track; the prior of its velocity is that of the speed only."""
        prior = np.zeros((4, 4))
        prior[2:, 2:] = np.eye(2) / SPEED_SIGMA**2
        state, covariance = _joined(prior, np.zeros(4), measurement)
        return Track(state, covariance, measurement.radius, measurement.time)

    def _predicted(self, track: Track, time: float) -> tuple[Array, Array]:
        """Predict state and covariance at ``time`` [s]."""
        dt = time - track.time
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        push = np.vstack([0.5 * dt * dt * np.eye(2), dt * np.eye(2)])
        covariance = product(step, track.covariance, step.T)
        covariance += product(ACCELERATION_SIGMA**2 * push, push.T) + 1e-9 * np.eye(4)
        return product(step, track.state), covariance

    def _association_cost(self, track: Track, measurement: _Measurement) -> float:
        """Compute the cost [sigma] of associating these two; inf outside the gates.

        The Mahalanobis distance of the positions, plus the change of velocity in units of
        _VELOCITY_SIGMA. The latter distinguishes objects that pass each other; it is bounded by the
        gate, so an object that turns round keeps its track.
        """
        state, covariance = self._predicted(track, measurement.time)
        off = measurement.position - state[:2]
        spread = covariance[:2, :2] + inverse(measurement.position_information)
        distance = math.sqrt(float(product(off, solve(spread, off))))
        if distance > self.params.gate or math.hypot(*off) > _GATE_DISTANCE:
            return math.inf
        change = math.dist(measurement.velocity, track.velocity)
        if track.hits < self.params.min_hits and change > _MAX_CHANGE:
            return math.inf
        return distance + min(change / _VELOCITY_SIGMA, self.params.gate)

    def _correct(self, track: Track, measurement: _Measurement) -> None:
        """Correct ``track`` by ``measurement`` (Kalman filter)."""
        state, covariance = self._predicted(track, measurement.time)
        prior: Array = np.asarray(inverse(covariance), dtype=np.float64)
        track.state, track.covariance = _joined(prior, product(prior, state), measurement)
        excess = math.hypot(*track.velocity) / self.params.max_speed
        if excess > 1.0:
            track.state[2:] /= excess
        track.radius += 0.5 * (measurement.radius - track.radius)
        track.time = measurement.time
        track.hits += 1

    def _path(self, track: Track, time: float) -> Iterable[OccupiedDisc]:
        """Yield discs along the track's predicted path, from ``time`` over the path time."""
        length = math.hypot(*track.velocity) * PATH_TIME
        steps = max(1, math.ceil(length / max(track.radius, 0.05)))
        for k in range(steps + 1):
            x, y = track.predict(time + PATH_TIME * k / steps)
            yield OccupiedDisc(x, y, track.radius)


def _joined(information: Array, evidence: Array, measurement: _Measurement) -> tuple[Array, Array]:
    """Compute state and covariance from a prior in information form and one measurement."""
    information, evidence = information.copy(), evidence.copy()
    information[:2, :2] += measurement.position_information
    information[2:, 2:] += measurement.velocity_information
    evidence[:2] += product(measurement.position_information, measurement.position)
    evidence[2:] += measurement.velocity_evidence
    covariance: Array = np.asarray(inverse(information), dtype=np.float64)
    return product(covariance, evidence), covariance
