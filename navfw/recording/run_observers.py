"""What takes in a run while it goes on: its log, a row per control tick; its recording as MCAP."""

from __future__ import annotations

import hashlib
import io
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from navfw.config.extras import extra_imports
from navfw.numerics import Array
from navfw.recording import channel_list as topics
from navfw.recording.channel_list import SeenRun
from navfw.signals import Belief, Pose, SensorReading, Sight, Twist, Waypoint

if TYPE_CHECKING:
    import pandas

_COLUMNS = 14
"""Columns of the rows that ``RunLogger`` collects."""


def hash_commands(commands: Array) -> str:
    """The sha256 (hex) of a command stream.

    ``commands`` (n, 3) holds time [s], v [m/s] and w [rad/s] of every control tick; hashed as
    little-endian float64, row after row, so that equal hashes mean equal bytes of commands.

    >>> hash_commands(np.zeros((0, 3)))[:8]
    'e3b0c442'
    """
    rows = np.ascontiguousarray(commands, dtype="<f8").reshape(-1, 3)
    return hashlib.sha256(rows.tobytes()).hexdigest()


@dataclass(frozen=True, slots=True)
class Contact:
    """The robot, its centre at x, y [m, map frame], touched ``body`` at ``time`` [s]."""

    time: float
    x: float
    y: float
    body: str


@dataclass(frozen=True, slots=True)
class RunLog:
    """A whole run, one row per control tick (n rows); poses are x, y [m], yaw [rad] in ``map``.

    ``true`` (n, 3) comes from the simulator, ``estimate`` (n, 3) from the stack's localiser.
    ``commands`` (n, 2) holds v [m/s] and w [rad/s]. ``leader`` (n,) indexes ``leaders``, the names
    of the leading behaviours. ``emergency`` (n,) marks ticks with an emergency command.
    ``waypoints`` are the planner's, in order. ``confidence`` (n,) in [0, 1] is that of the belief,
    0 while it is lost (None: not recorded). ``sight`` (n,) has the values of ``signals.Sight``.
    ``vetoed`` (n,) marks ticks in which the safety monitor held the robot. ``updates`` is the
    number of landmark detections that the localiser used, ``route_changes`` how often the places
    ahead were not those that were left of the route before.
    """

    time: Array
    true: Array
    estimate: Array
    commands: Array
    leader: npt.NDArray[np.int16]
    emergency: npt.NDArray[np.bool_]
    sight: npt.NDArray[np.int8]
    vetoed: npt.NDArray[np.bool_]
    leaders: tuple[str, ...]
    contacts: tuple[Contact, ...] = ()
    waypoints: tuple[Waypoint, ...] = ()
    confidence: Array | None = None
    updates: int = 0
    route_changes: int = 0

    @property
    def ticks(self) -> int:
        """Number of control ticks."""
        return len(self.time)

    @property
    def command_stream(self) -> Array:
        """(n, 3): time [s], v [m/s], w [rad/s]."""
        return np.column_stack([self.time, self.commands])

    @property
    def command_hash(self) -> str:
        """The fingerprint of the command stream (see ``hash_commands``)."""
        return hash_commands(self.command_stream)

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """The log as columns by name, one value per control tick; poses and commands by part."""
        names = np.array([*self.leaders, ""], dtype=object)
        columns: dict[str, npt.NDArray[Any]] = {"time": self.time}
        for pose, rows in (("true", self.true), ("estimate", self.estimate)):
            columns |= {f"{pose}_{axis}": rows[:, at] for at, axis in enumerate(("x", "y", "yaw"))}
        columns |= {"v": self.commands[:, 0], "w": self.commands[:, 1]}
        columns |= {"leader": names[self.leader], "emergency": self.emergency}
        columns |= {"sight": self.sight, "vetoed": self.vetoed}
        return columns if self.confidence is None else columns | {"confidence": self.confidence}

    def to_pandas(self) -> pandas.DataFrame:
        """The log as a table: a row per control tick, the columns of ``columns``.

        Raises:
            MissingExtraError: pandas is not installed.

        """
        with extra_imports("pandas"):
            import pandas
        return pandas.DataFrame(self.columns())

    def every(self, period: float) -> npt.NDArray[np.intp]:
        """Indices of ticks about ``period`` [s] apart, including the first and the last."""
        if self.ticks < 2:
            return np.arange(self.ticks)
        tick = (self.time[-1] - self.time[0]) / (self.ticks - 1)
        step = max(1, round(period / tick)) if tick > 0.0 else 1
        picked = np.arange(0, self.ticks, step)
        return picked if picked[-1] == self.ticks - 1 else np.append(picked, self.ticks - 1)


@dataclass(slots=True)
class RunLogger:
    """Collects a ``RunLog`` tick by tick."""

    contacts: list[Contact] = field(default_factory=list)
    _rows: array[float] = field(init=False, default_factory=lambda: array("d"))
    _leaders: dict[str, int] = field(init=False, default_factory=dict)
    _updates: int = field(init=False, default=0)
    _ahead: tuple[str, ...] = field(init=False, default=())
    _route_changes: int = field(init=False, default=0)
    _waypoints: dict[tuple[float, float, str], Waypoint] = field(init=False, default_factory=dict)

    @property
    def ticks(self) -> int:
        """Number of ticks added so far."""
        return len(self._rows) // _COLUMNS

    def add(
        self,
        time: float,
        true: Pose,
        estimate: Pose,
        twist: Twist,
        leader: str,
        emergency: bool,
        belief: Belief | None = None,
        sight: Sight = Sight.ENOUGH,
        vetoed: bool = False,
    ) -> None:
        """Add one control tick; ``belief``, if given, has the confidence of ``estimate``."""
        lost = belief is not None and belief.lost
        confidence = 0.0 if lost else 1.0 if belief is None else belief.confidence
        self._updates = self._updates if belief is None else belief.updates
        number = self._leaders.setdefault(leader, len(self._leaders))
        poses = true.x, true.y, true.yaw, estimate.x, estimate.y, estimate.yaw
        marks = number, emergency, sight, confidence, vetoed
        self._rows.extend((time, *poses, twist.v, twist.w, *marks))

    def add_waypoints(self, waypoints: tuple[Waypoint, ...]) -> None:
        """Add the planner's waypoints ahead; waypoints already in the log are not repeated."""
        ahead = tuple(waypoint.place for waypoint in waypoints)
        left = self._ahead[len(self._ahead) - len(ahead) :]
        self._route_changes += bool(self._ahead) and ahead != left
        self._ahead = ahead
        for waypoint in waypoints:
            self._waypoints.setdefault((waypoint.x, waypoint.y, waypoint.place), waypoint)

    def log(self) -> RunLog:
        """The log of all ticks added so far."""
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, _COLUMNS)
        return RunLog(
            time=rows[:, 0],
            true=rows[:, 1:4],
            estimate=rows[:, 4:7],
            commands=rows[:, 7:9],
            leader=rows[:, 9].astype(np.int16),
            emergency=rows[:, 10].astype(np.bool_),
            sight=rows[:, 11].astype(np.int8),
            leaders=tuple(self._leaders),
            contacts=tuple(self.contacts),
            waypoints=tuple(self._waypoints.values()),
            confidence=rows[:, 12],
            vetoed=rows[:, 13].astype(np.bool_),
            updates=self._updates,
            route_changes=self._route_changes,
        )


_CHUNK = 1 << 18
"""Size of a chunk before compression [byte]: a second or two, which a cut file loses at most."""


class RunObserver(Protocol):
    """Takes in every control tick of a run, after the stack; it must change nothing in it."""

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Take in one control tick: reading, the stack's command for it, and the true pose."""
        ...

    def close(self) -> None:
        """End: the run is over."""
        ...


class RunRecorder:
    """Collects a run in memory until ``save``: its readings, and what is ``seen`` of it.

    At most ``max_bytes`` of images, and of the file: ``complete`` is false once that limit has been
    reached, and what follows is left out.
    """

    def __init__(
        self,
        metadata: Mapping[str, str] | None = None,
        seen: SeenRun | None = None,
        max_bytes: int = topics.MAX_BYTES,
    ) -> None:
        with extra_imports("record"):
            from foxglove import Context, open_mcap
            from foxglove.mcap import MCAPWriteOptions

        from navfw.recording.run_channels import RunChannels, context_channels

        context = Context()
        self.complete = True
        self._max_bytes = max_bytes
        self._unpacked = 0
        self._file = io.BytesIO()
        options = MCAPWriteOptions(
            profile=f"{topics.PROFILE}{topics.FORMAT_VERSION}",
            chunk_size=_CHUNK,
            compression_level=1,
            compression_threads=0,
        )
        self._writer = open_mcap(self._file, context=context, writer_options=options)
        self._writer.write_metadata(topics.RUN, dict(metadata or {}))
        self._channels = RunChannels(context_channels(context), seen)
        self._closed = False

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose | None) -> None:
        """Add one control tick: reading, the stack's command, and the true pose if it is known."""
        frames = [frame for frame in (reading.frame, reading.landmark_frame) if frame is not None]
        images = [image for frame in frames for image in (frame.image, *frame.sides)]
        self._unpacked += 96 + sum(image.nbytes for image in images)
        if max(self._unpacked, self._file.tell()) > self._max_bytes:
            self.complete = False
        if self.complete:
            self._channels.observe(reading, twist, pose)

    def log_driven(self, twist: Twist, time: float) -> None:
        """Add what another commanded the robot at ``time`` [s], in the stack's stead."""
        if self.complete:
            self._channels.log_driven(twist, time)

    def close(self) -> None:
        """End the recording: nothing can be added afterwards."""
        if self._closed:
            return
        self._closed = True
        self._channels.close()
        if self.complete:
            # metadata without an entry are not written
            self._writer.write_metadata(topics.END, {"complete": "yes"})
        self._writer.close()

    def save(self, path: Path) -> None:
        """Write the recording to ``path``, ended if it was not."""
        self.close()
        path.write_bytes(self._file.getbuffer())
