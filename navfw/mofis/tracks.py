"""Where movers are and where they go: short tracks of what moves by itself, in the odom frame.

A sighting gives a bearing and, by the floor, a distance; successive sightings that lie near each
other are one mover, whose velocity an alpha-beta filter estimates (Kalata 1984). What is not seen
again is soon forgotten.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from navfw.robot import RobotModel
from navfw.signals import Mover, Pose

__all__ = ["Disc", "Track", "TrackParams", "Tracks"]

Positive = Annotated[float, Field(gt=0.0)]


class TrackParams(BaseModel):
    """How movers are followed from look to look."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    linger: Annotated[
        Positive, Field(le=30.0, description="a mover not seen again is kept so long [s]")
    ] = 1.2
    jump: Annotated[
        Positive, Field(description="sightings farther apart than this are two movers [m]")
    ] = 0.7
    alpha: Annotated[float, Field(gt=0.0, le=1.0, description="weight of a new place")] = 0.5
    beta: Annotated[
        float, Field(ge=0.0, le=1.0, description="weight of a new place for the velocity")
    ] = 0.15
    believed: Annotated[
        int, Field(ge=1, le=50, description="sightings before a mover takes any floor")
    ] = 2
    sure: Annotated[int, Field(ge=2, le=50, description="sightings before a velocity counts")] = 4
    fastest: Annotated[Positive, Field(description="no mover is taken to be faster [m/s]")] = 1.0
    foresight: Annotated[
        float, Field(ge=0.0, le=5.0, description="how far ahead its way is kept free [s]")
    ] = 1.5
    radius: Annotated[
        tuple[Positive, Positive], Field(description="least and largest radius of a mover [m]")
    ] = (0.12, 0.35)


@dataclass(frozen=True, slots=True)
class Disc:
    """A round piece of floor that is taken: centre in odom and radius [m]."""

    x: float
    y: float
    radius: float


@dataclass(slots=True)
class Track:
    """One mover: place [m] and velocity [m/s] in odom at ``time`` [s], ``seen`` so many times."""

    x: float
    y: float
    radius: float
    time: float
    vx: float = 0.0
    vy: float = 0.0
    seen: int = 1

    def at(self, time: float) -> tuple[float, float]:
        """Where it is expected at ``time`` [s]."""
        dt = time - self.time
        return self.x + self.vx * dt, self.y + self.vy * dt


class Tracks:
    """All movers of the last moments."""

    def __init__(self, robot: RobotModel, params: TrackParams | None = None) -> None:
        self.params = params or TrackParams()
        self._camera = robot.camera
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self.tracks: list[Track] = []

    def see(
        self,
        movers: Iterable[Mover],
        pose: Pose,
        time: float,
        is_static: Callable[[float, float, float], bool] = lambda x, y, radius: False,
    ) -> None:
        """Enter the ``movers`` seen from odom ``pose`` at ``time`` [s].

        Where ``is_static`` (x, y, radius [m]) knows that something stands, none begins: at the
        edges of near things flow is often contradictory.
        """
        self.forget(time)
        known = list(self.tracks)
        for mover in movers:
            sighting = self._place(mover, pose, time)
            off = [math.dist(track.at(time), (sighting.x, sighting.y)) for track in known]
            if not off or min(off) > self.params.jump:
                if not is_static(sighting.x, sighting.y, sighting.radius):
                    self.tracks.append(sighting)
            else:
                self._update(known.pop(off.index(min(off))), sighting)

    def forget(self, time: float) -> None:
        """Drop those that have not been seen for long."""
        self.tracks = [t for t in self.tracks if time - t.time <= self.params.linger]

    def discs(self, time: float) -> tuple[Disc, ...]:
        """The floor that movers take, or are going to take within the foresight."""
        believed = [track for track in self.tracks if track.seen >= self.params.believed]
        return tuple(disc for track in believed for disc in self._way(track, time))

    def _place(self, mover: Mover, pose: Pose, time: float) -> Track:
        """A new track from one sighting: its visible front is at the mover's distance."""
        least, largest = self.params.radius
        radius = min(max(mover.distance * math.tan(mover.width), least), largest)
        away = mover.distance + radius
        x, y = pose.to_parent(
            self._camera.mount_forward + away * math.cos(mover.bearing),
            away * math.sin(mover.bearing),
        )
        return Track(x, y, radius, time)

    def _update(self, track: Track, sighting: Track) -> None:
        p = self.params
        dt = sighting.time - track.time
        x, y = track.at(sighting.time)
        off_x, off_y = sighting.x - x, sighting.y - y
        track.x, track.y = x + p.alpha * off_x, y + p.alpha * off_y
        if dt > 0.0:
            track.vx += p.beta * off_x / dt
            track.vy += p.beta * off_y / dt
            excess = math.hypot(track.vx, track.vy) / p.fastest
            if excess > 1.0:
                track.vx, track.vy = track.vx / excess, track.vy / excess
        track.radius += p.alpha * (sighting.radius - track.radius)
        track.time = sighting.time
        track.seen += 1

    def _way(self, track: Track, time: float) -> Iterable[Disc]:
        """Discs along the track's way, from now to the foresight's end."""
        if track.seen < self.params.sure:
            yield Disc(track.x, track.y, track.radius)
            return
        length = math.hypot(track.vx, track.vy) * self.params.foresight
        steps = max(1, math.ceil(length / max(track.radius, 0.05)))
        for k in range(steps + 1):
            yield Disc(*track.at(time + self.params.foresight * k / steps), track.radius)
