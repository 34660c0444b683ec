"""Where movers are and where they go: short tracks of what moves by itself, in the odom frame.

A detection gives a bearing, by the floor a distance, and by its vectors a velocity. Detections that
lie near each other are one mover; a Kalman filter with constant velocity follows it. What is not
seen again is soon forgotten, but not what has only left the view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from navfw.robot import RobotModel
from navfw.signals import Array, MovingObject, Pose

__all__ = ["Disc", "Track", "TrackParams", "Tracks"]

Positive = Annotated[float, Field(gt=0.0)]

EDGE = math.radians(7.0)
"""At the border of the view movers are seen in part, or not at all [rad]."""
TWINS = 0.3
"""Two people do not come nearer to each other than this [m]."""
AGO, OVERLAP = 0.25, 0.03
"""Who was seen so long ago [s] and would by now be so deep [m] in the robot has gone elsewhere."""
STRAY = 0.8
"""Who is seen farther off [m] than somebody is expected is another, however long ago that was."""
CHANGE = 0.2
"""Change of velocity [m/s] that makes a detection as unlikely as one sigma of place."""
ROUGH = 0.06
"""A mover is no disc, and seen in part from near [m]."""
FARTHEST = 2.0
"""Farther off [m] movers are often overlooked."""


class TrackParams(BaseModel):
    """How movers are followed from look to look."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    linger: Annotated[
        Positive, Field(le=30.0, description="a mover not seen again in view is kept so long [s]")
    ] = 1.0
    memory: Annotated[
        Positive, Field(le=30.0, description="one that has left the view is kept so long [s]")
    ] = 4.0
    gate: Annotated[
        Positive, Field(description="a detection farther off is of another mover [sigma]")
    ] = 3.0
    bearing_sigma: Annotated[
        Positive, Field(description="error of a detection's bearing [rad]")
    ] = 0.06
    distance_sigma: Annotated[
        Positive, Field(description="error of a detection's distance, relative [1]")
    ] = 0.2
    walking: Annotated[Positive, Field(description="how fast movers go, one sigma [m/s]")] = 0.4
    swerve: Annotated[
        Positive, Field(description="how soon they turn, one sigma of acceleration [m/s^2]")
    ] = 0.5
    believed: Annotated[
        int, Field(ge=1, le=50, description="detections before a mover takes any floor")
    ] = 2
    fastest: Annotated[Positive, Field(description="no mover is taken to be faster [m/s]")] = 1.0
    foresight: Annotated[
        float, Field(ge=0.0, le=5.0, description="how far ahead its way is kept free [s]")
    ] = 0.6
    radius: Annotated[
        tuple[Positive, Positive], Field(description="least and largest radius of a mover [m]")
    ] = (0.22, 0.35)


@dataclass(frozen=True, slots=True)
class Disc:
    """A round piece of floor that is taken: centre in odom and radius [m]."""

    x: float
    y: float
    radius: float


@dataclass(slots=True, eq=False)
class Track:
    """One mover: ``state`` (x, y, vx, vy) [m, m/s] in odom at ``time`` [s], with its covariance.

    It was ``seen`` so many times.
    """

    state: Array
    covariance: Array
    radius: float
    time: float
    seen: int = 1

    def at(self, time: float) -> tuple[float, float]:
        """Where it is expected at ``time`` [s]."""
        dt = time - self.time
        x, y, vx, vy = self.state.tolist()
        return x + vx * dt, y + vy * dt

    @property
    def velocity(self) -> tuple[float, float]:
        """(vx, vy) [m/s] in odom."""
        return float(self.state[2]), float(self.state[3])


@dataclass(frozen=True, slots=True)
class _Sighting:
    """A mover in odom: its centre with information (2, 2); information and evidence of velocity.

    ``velocity`` (2,) is what they make likely [m/s].
    """

    time: float
    place: Array
    place_information: Array
    velocity_information: Array
    velocity_evidence: Array
    velocity: Array
    radius: float


class Tracks:
    """All movers of the last moments."""

    def __init__(self, robot: RobotModel, params: TrackParams | None = None) -> None:
        self.params = params or TrackParams()
        camera = self._camera = robot.camera
        self._aside = robot.seen_aside
        self._radius = robot.radius
        lowest = math.atan(0.5 * camera.height / camera.focal) + camera.pitch
        # nearer than this the feet are below the image
        self._reach = (
            camera.mount_height / math.tan(lowest) if lowest > 0.0 else math.inf,
            FARTHEST,
        )
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self.tracks: list[Track] = []

    def see(self, movers: Iterable[MovingObject], pose: Pose) -> None:
        """Enter the ``movers`` seen from odom ``pose``."""
        detections = [self._place(mover, pose) for mover in movers]
        known = self._recognise(detections)
        for index, detection in enumerate(detections):
            if index in known:
                self._update(known[index], detection)
            else:
                known[index] = self._begin(detection)
                self.tracks.append(known[index])
        for track in known.values():
            self._drop_twins(track)

    def _recognise(self, detections: Sequence[_Sighting]) -> dict[int, Track]:
        """Who is seen in which detection, by its index: whoever fits best comes first."""
        fits = [
            (self._misfit(track, detection), index, number)
            for index, detection in enumerate(detections)
            for number, track in enumerate(self.tracks)
        ]
        recognised: dict[int, Track] = {}
        for misfit, index, number in sorted(fits):
            track = self.tracks[number]
            if misfit == math.inf:
                break
            if index not in recognised and track not in recognised.values():
                recognised[index] = track
        return recognised

    def _drop_twins(self, track: Track) -> None:
        """Drop what was taken for somebody else and stands where this ``track`` was just seen.

        Both are the same mover, who was seen as often as the one of them that was seen oftener.
        """
        here = track.at(track.time)
        twins = [
            other
            for other in self.tracks
            if other.time != track.time and math.dist(other.at(track.time), here) <= TWINS
        ]
        track.seen = max((track.seen, *(twin.seen for twin in twins)))
        self.tracks = [other for other in self.tracks if other not in twins]

    def forget(self, time: float, pose: Pose) -> None:
        """Drop those not seen for long, where a robot at odom ``pose`` would see them or not."""
        p = self.params
        self.tracks = [
            track
            for track in self.tracks
            if time - track.time <= (p.linger if self._in_view(track, time, pose) else p.memory)
            and self._may_be(track, time, pose)
        ]

    def _may_be(self, track: Track, time: float, pose: Pose) -> bool:
        """Whether it can be where it is expected: not, some time after, where the robot stands."""
        away = math.dist(track.at(time), (pose.x, pose.y))
        return time - track.time <= AGO or away > self._radius + track.radius - OVERLAP

    @property
    def believed(self) -> tuple[Track, ...]:
        """Those seen often enough to be taken for real."""
        return tuple(track for track in self.tracks if track.seen >= self.params.believed)

    def discs(self, time: float) -> tuple[Disc, ...]:
        """The floor that movers take, or are going to take within the foresight."""
        return tuple(disc for track in self.believed for disc in self._way(track, time))

    def _in_view(self, track: Track, time: float, pose: Pose) -> bool:
        """Whether it should be seen if it were where it is expected."""
        ahead, left = pose.to_local(*track.at(time))
        ahead -= self._camera.mount_forward
        near, far = self._reach
        return near <= math.hypot(ahead, left) <= far and (
            abs(math.atan2(left, ahead)) <= self._aside - EDGE
        )

    def _place(self, mover: MovingObject, pose: Pose) -> _Sighting:
        """One detection in odom: the mover's visible front is at its distance."""
        p = self.params
        radius = min(max(mover.distance * math.tan(mover.width), p.radius[0]), p.radius[1])
        away = mover.distance + radius
        ahead, aside = math.cos(mover.bearing), math.sin(mover.bearing)
        place = pose.to_parent(self._camera.mount_forward + away * ahead, away * aside)
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turn = np.array([[c, -s], [s, c]])
        sight = turn @ np.array([[ahead, -aside], [aside, ahead]])
        spread = np.hypot([p.distance_sigma * mover.distance, p.bearing_sigma * away], ROUGH)
        return _Sighting(
            mover.time,
            np.array(place),
            sight @ np.diag(spread**-2.0) @ sight.T,
            turn @ mover.information @ turn.T,
            turn @ mover.evidence,
            turn @ np.array(mover.velocity(p.walking)),
            radius,
        )

    def _begin(self, detection: _Sighting) -> Track:
        """A new track; of its velocity nothing is known but how fast movers go."""
        prior = np.zeros((4, 4))
        prior[2:, 2:] = np.eye(2) / self.params.walking**2
        state, covariance = _joined(prior, np.zeros(4), detection)
        return Track(state, covariance, detection.radius, detection.time)

    def _expected(self, track: Track, time: float) -> tuple[Array, Array]:
        """State and covariance at ``time`` [s], from what was seen until now."""
        dt = time - track.time
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        push = np.vstack([0.5 * dt * dt * np.eye(2), dt * np.eye(2)])
        covariance = step @ track.covariance @ step.T
        covariance += self.params.swerve**2 * push @ push.T + 1e-9 * np.eye(4)
        return step @ track.state, covariance

    def _misfit(self, track: Track, detection: _Sighting) -> float:
        """How little [sigma] ``detection`` fits ``track``, by place and velocity; inf: not at all.

        Its place must be within the gate (Mahalanobis). Velocities only tell people apart that pass
        each other: somebody who turns round stays who he is.
        """
        state, covariance = self._expected(track, detection.time)
        off = detection.place - state[:2]
        spread = covariance[:2, :2] + np.linalg.inv(detection.place_information)
        distance = math.sqrt(float(off @ np.linalg.solve(spread, off)))
        if distance > self.params.gate or math.hypot(*off) > STRAY:
            return math.inf
        change = math.dist(detection.velocity, track.velocity)
        return distance + min(change / CHANGE, self.params.gate)

    def _update(self, track: Track, detection: _Sighting) -> None:
        state, covariance = self._expected(track, detection.time)
        prior: Array = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        track.state, track.covariance = _joined(prior, prior @ state, detection)
        excess = math.hypot(*track.velocity) / self.params.fastest
        if excess > 1.0:
            track.state[2:] /= excess
        track.radius += 0.5 * (detection.radius - track.radius)
        track.time = detection.time
        track.seen += 1

    def _way(self, track: Track, time: float) -> Iterable[Disc]:
        """Discs along the track's way, from now to the foresight's end."""
        length = math.hypot(*track.velocity) * self.params.foresight
        steps = max(1, math.ceil(length / max(track.radius, 0.05)))
        for k in range(steps + 1):
            yield Disc(*track.at(time + self.params.foresight * k / steps), track.radius)


def _joined(information: Array, evidence: Array, detection: _Sighting) -> tuple[Array, Array]:
    """State and covariance from what was known (information form) and one detection."""
    information, evidence = information.copy(), evidence.copy()
    information[:2, :2] += detection.place_information
    information[2:, 2:] += detection.velocity_information
    evidence[:2] += detection.place_information @ detection.place
    evidence[2:] += detection.velocity_evidence
    covariance: Array = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return covariance @ evidence, covariance
