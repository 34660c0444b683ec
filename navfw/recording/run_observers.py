"""Collect a run while it goes on: its log, a row per control tick; its recording as MCAP."""

from __future__ import annotations

import errno
import hashlib
import shutil
import tempfile
import weakref
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from navfw.config.extras import extra_imports
from navfw.numerics import Array
from navfw.process.interruption import deferred
from navfw.recording import channel_list as topics
from navfw.recording.channel_list import SeenRun
from navfw.signals import Belief, Pose, SensorReading, Sight, Twist, Waypoint

if TYPE_CHECKING:
    import pandas

_COLUMNS, _MARKS = 10, 5
"""Columns of the rows that ``RunLogger`` collects: numbers, and integer marks."""


def hash_commands(commands: Array) -> str:
    """Return the SHA-256 (hex) of a series of commands.

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
    ``vetoed`` (n,) marks ticks in which the safety monitor held the robot. ``slower`` (n,) indexes
    ``slowers``, the reasons why the robot was below its top speed, "" at top speed. ``updates`` is
    the number of landmark detections that the localiser used, ``route_changes`` how often the
    places ahead differed from the rest of the route before.
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
    slower: npt.NDArray[np.int16] = field(default_factory=lambda: np.zeros(0, np.int16))
    slowers: tuple[str, ...] = ()
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
        """Commands with their times, (n, 3): time [s], v [m/s], w [rad/s]."""
        return np.column_stack([self.time, self.commands])

    @property
    def command_hash(self) -> str:
        """The hash of ``command_stream`` (see ``hash_commands``)."""
        return hash_commands(self.command_stream)

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """Return the log as columns by name, one value per control tick; poses are split."""
        names = np.array([*self.leaders, ""], dtype=object)
        columns: dict[str, npt.NDArray[Any]] = {"time": self.time}
        for pose, rows in (("true", self.true), ("estimate", self.estimate)):
            columns |= {f"{pose}_{axis}": rows[:, at] for at, axis in enumerate(("x", "y", "yaw"))}
        columns |= {"v": self.commands[:, 0], "w": self.commands[:, 1]}
        columns |= {"leader": names[self.leader], "emergency": self.emergency}
        columns |= {"sight": self.sight, "vetoed": self.vetoed}
        return columns if self.confidence is None else columns | {"confidence": self.confidence}

    def to_pandas(self) -> pandas.DataFrame:
        """Return the log as a table: a row per control tick, the columns of ``columns``.

        Raises:
            MissingExtraError: pandas is not installed.

        """
        with extra_imports("pandas"):
            import pandas
        return pandas.DataFrame(self.columns())

    def every(self, period: float) -> npt.NDArray[np.intp]:
        """Return indices of ticks about ``period`` [s] apart, including the first and the last."""
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
    _marks: array[int] = field(init=False, default_factory=lambda: array("h"))
    _leaders: dict[str, int] = field(init=False, default_factory=dict)
    _slowers: dict[str, int] = field(init=False, default_factory=dict)
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
        slower: str = "",
    ) -> None:
        """Add a control tick; ``belief``, if given, has the confidence of ``estimate``."""
        lost = belief is not None and belief.lost
        confidence = 0.0 if lost else 1.0 if belief is None else belief.confidence
        self._updates = self._updates if belief is None else belief.updates
        number = self._leaders.setdefault(leader, len(self._leaders))
        poses = true.x, true.y, true.yaw, estimate.x, estimate.y, estimate.yaw
        self._rows.extend((time, *poses, twist.v, twist.w, confidence))
        bound = self._slowers.setdefault(slower, len(self._slowers))
        self._marks.extend((number, emergency, sight, vetoed, bound))

    def add_waypoints(self, waypoints: tuple[Waypoint, ...]) -> None:
        """Add the planner's waypoints ahead; those already in the log are not repeated."""
        ahead = tuple(waypoint.place for waypoint in waypoints)
        left = self._ahead[len(self._ahead) - len(ahead) :]
        self._route_changes += bool(self._ahead) and ahead != left
        self._ahead = ahead
        for waypoint in waypoints:
            self._waypoints.setdefault((waypoint.x, waypoint.y, waypoint.place), waypoint)

    def log(self) -> RunLog:
        """Return the log of all ticks added so far."""
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, _COLUMNS)
        marks = np.array(self._marks, dtype=np.int16).reshape(-1, _MARKS)
        return RunLog(
            time=rows[:, 0],
            true=rows[:, 1:4],
            estimate=rows[:, 4:7],
            commands=rows[:, 7:9],
            leader=marks[:, 0],
            emergency=marks[:, 1].astype(np.bool_),
            sight=marks[:, 2].astype(np.int8),
            leaders=tuple(self._leaders),
            contacts=tuple(self.contacts),
            waypoints=tuple(self._waypoints.values()),
            confidence=rows[:, 9],
            vetoed=marks[:, 3].astype(np.bool_),
            slower=marks[:, 4],
            slowers=tuple(self._slowers),
            updates=self._updates,
            route_changes=self._route_changes,
        )


_CHUNK = 1 << 18
"""Size of a chunk before compression [byte]: a second or two, which a cut file loses at most."""
_ROOM = 1 << 20
"""Space [byte] that a recording frees on a full disk, for the result and the picture."""


class _RecordingFile:
    """A file that is written while the robot drives: a full disk ends the file, not the run.

    ``kept`` [byte] is its size, ``size`` the size with all that should have been written, ``error``
    why the rest is left out, None if nothing is.
    """

    def __init__(self, path: Path | None) -> None:
        self._file: Any = path.open("xb", 0) if path else tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
        self.close = weakref.finalize(self, self._file.close)
        self.kept = self.size = 0
        self.error: OSError | None = None

    def write(self, data: bytes | bytearray) -> int:
        """Append a record or chunk, all of it or nothing."""
        try:
            rest = memoryview(data)
            while rest and self.error is None:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            full = error.errno in {errno.ENOSPC, errno.EDQUOT}
            self.kept = max(0, self.kept - _ROOM) if full else self.kept
            self._file.truncate(self.kept)
            self.error = error
        self.size += len(data)
        self.kept += len(data) if self.error is None else 0
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Return where the file ends: the writer asks for nothing else."""
        del offset, whence
        return self.size

    def flush(self) -> None:
        """Do nothing, as nothing is buffered."""

    def copy_to(self, path: Path) -> None:
        """Write a temporary file to ``path``."""
        self._file.seek(0)
        with path.open("wb") as copy:
            shutil.copyfileobj(self._file, copy)


class RunRecorder:
    """Records a run into the file ``path``: its readings, and the state of ``seen`` if given.

    Chunks are written as the robot drives: a process that is killed leaves all but the last second
    or two. Without ``path`` they go to a temporary file, until ``save``. Images, and the file, have
    at most ``MAX_BYTES`` each: ``complete`` is False once a limit has been reached, or the disk is
    full (``error``); later ticks are then left out.

    Raises:
        OSError: the file cannot be created.

    """

    def __init__(
        self,
        metadata: Mapping[str, str] | None = None,
        seen: SeenRun | None = None,
        path: Path | None = None,
    ) -> None:
        with extra_imports("record"):
            from foxglove import Context, open_mcap
            from foxglove.mcap import MCAPWriteOptions

        from navfw.recording.run_channels import RunChannels, context_channels

        context = Context()
        self.complete = True
        self._unpacked = 0
        self.path = path
        self._file = _RecordingFile(path)
        options = MCAPWriteOptions(
            profile=f"{topics.PROFILE}{topics.FORMAT_VERSION}",
            chunk_size=_CHUNK,
            compression_level=3,
            compression_threads=0,
            disable_seeking=True,  # whole chunks, one after the other
        )
        self._writer = open_mcap(self._file, context=context, writer_options=options)
        self._writer.write_metadata(topics.RUN, dict(metadata or {}))
        self._channels = RunChannels(context_channels(context), seen)
        self._closed = False

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose | None) -> None:
        """Record a control tick: reading, the stack's command, and the true pose if known."""
        frames = [frame for frame in (reading.frame, reading.landmark_frame) if frame is not None]
        images = [image for frame in frames for image in (frame.image, *frame.sides)]
        self._unpacked += 96 + sum(image.nbytes for image in images)
        if max(self._unpacked, self._file.size) > topics.MAX_BYTES:
            self.complete = False
        if self.complete:
            with deferred():  # the writer would take an interruption for a failure of its file
                self._channels.observe(reading, twist, pose)
                self.complete = self.error is None

    def log_driven(self, twist: Twist, time: float) -> None:
        """Record the command that moved the robot at ``time`` [s] while the stack did not."""
        if self.complete:
            with deferred():
                self._channels.log_driven(twist, time)

    def close(self) -> None:
        """End the recording: nothing can be added afterwards."""
        if self._closed:
            return
        self._closed = True
        with deferred():
            if self.complete:
                # metadata without an entry are not written
                self._writer.write_metadata(topics.END, {"complete": "yes"})
            self._writer.close()
            self.complete = self.complete and self.error is None
            if self.path is not None:
                self._file.close()

    @property
    def error(self) -> OSError | None:
        """Why the file could not be written to the end of the run; None if it could."""
        return self._file.error

    def save(self, path: Path) -> None:
        """Close the recording, and copy it to ``path`` if it is not there.

        Raises:
            OSError: it cannot be written, or nothing of it could.

        """
        self.close()
        if self.error is not None and not self._file.kept:
            raise self.error
        if path != self.path:
            self._file.copy_to(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        """After an exception, which occurs only if a run did not begin, delete the recording."""
        if kind is not None:
            self._file.error = self._file.error or OSError("discarded")
            self.close()
            if self.path is not None:
                self.path.unlink(missing_ok=True)
