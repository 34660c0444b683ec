"""Writes the files of a run folder: ``result.json``, trajectories, picture, inputs of a replay.

The picture shows the true path coloured by leading behaviour, with times, and the movers.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.missions.mission_events import EventRecord
from navfw.missions.run_drawing import outline_of
from navfw.missions.run_metrics import SAMPLING, UNFINISHED
from navfw.missions.session import MissionResult, Session
from navfw.numerics import Array
from navfw.process.atomic import writing
from navfw.process.interruption import deferred, interruptible
from navfw.recording import palette, plan_picture, top_view
from navfw.recording.provenance import code_revision, library_versions, machine_kind
from navfw.recording.run_folder import (
    ESTIMATED,
    EXPLORED,
    MAP,
    PICTURE,
    RECORDING,
    RESULT,
    TRUTH,
    RunFolder,
)
from navfw.recording.run_observers import RunLog, RunRecorder
from navfw.topomap.map_formats import save_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def default_folder(session: Session) -> Path:
    """Return the default run folder: ``runs/<world>-<mission>-<seed>``."""
    return Path("runs") / f"{session.world_name}-{session.mission_name}-{session.seed}"


class RecordedFolder:
    """Writes the files that a recorded run has from its start into the folder of ``target``.

    With these files and the recording so far, a run can be viewed and replayed while it goes on,
    and after its process was killed.

    Raises:
        InputError: the files cannot be written.

    """

    def __init__(self, session: Session, target: RunFolder) -> None:
        self._target = target
        self._result = {
            "outcome": UNFINISHED,
            "reason": "the run goes on, or its process was killed",
            **{name: session.description[name] for name in ("world", "mission", "seed")},
            **_origin(session),
        }
        with writing(target.target):
            self._write(())
            target.write_inputs(session.stack.config, session.mission.topo_map)
            target.show_unfinished()
            self.recorder = RunRecorder(
                session.description, session.seen, path=target.path / RECORDING
            )

    def told(self, events: Sequence[EventRecord]) -> None:
        """Write the mission's ``events`` so far: a replay repeats those of behaviours."""
        with suppress(OSError):  # of a full disk, which costs no run
            self._write(events)

    def _write(self, events: Sequence[EventRecord]) -> None:
        self._target.write_json(RESULT, {**self._result, "events": [*map(asdict, events)]})


def write_run(result: MissionResult, target: RunFolder) -> tuple[str, ...]:
    """Write all files of the run into the (temporary) folder of ``target``, the result first.

    Returns messages about missing files: if a picture or recording cannot be written, or the user
    interrupts it, the result is kept.

    Raises:
        InputError: the result cannot be written.

    """
    with deferred(), writing(target.target / RESULT):
        trace = result.verdict.trace
        target.write_json(RESULT, {**result.summary(), "trace": trace, **_origin(result.session)})
    writers: dict[str, Callable[[Path], object]] = {}
    if result.recorder is not None:
        if not (target.path / MAP).exists():
            inputs = result.session.stack.config, result.session.mission.topo_map
            writers[MAP] = lambda _: target.write_inputs(*inputs)
        writers[RECORDING] = result.recorder.save
    if result.exploration is not None:
        writers[EXPLORED] = lambda path: save_map(result.explored_map(EXPLORED), path)
    log = result.log
    rows = log.every(SAMPLING)
    for name, poses in ((ESTIMATED, log.estimate), (TRUTH, log.true)):
        writers[name] = partial(write_tum, time=log.time[rows], poses=poses[rows])
    writers[PICTURE] = lambda path: draw_trajectory(result, path)
    with deferred():  # a recording without its inputs could not be replayed
        missing = [
            (name, _why_missing(target.path / name, write)) for name, write in writers.items()
        ]
    said = [f"{name} is missing: {why}" for name, why in missing if why]
    error = None if result.recorder is None else result.recorder.error
    if error is not None and (target.path / RECORDING).exists():
        said.append(f"{RECORDING} ends before the run: {error.strerror or error}")
    return tuple(said)


def write_tum(path: Path, time: Array, poses: Array) -> None:
    """Write ``poses`` (n, 3; x, y [m], yaw [rad]) at ``time`` (n,) [s] in the format of TUM."""
    half, none = 0.5 * poses[:, 2], np.zeros(len(time))
    rows = np.column_stack([time, poses[:, :2], none, none, none, np.sin(half), np.cos(half)])
    np.savetxt(path, rows, "%.6f", header="timestamp tx ty tz qx qy qz qw")


def _origin(session: Session) -> dict[str, Any]:
    """What a run was made of, and where."""
    return {
        "config": session.config,
        "overrides": session.overrides,
        "versions": library_versions(),
        "stack": session.stack_file.stem,
        "revision": code_revision(),
        "machine": machine_kind(),
    }


def _why_missing(path: Path, write: Callable[[Path], object]) -> str:
    """Write a file of the run; returns why it is missing, "" if it is not."""
    try:
        with interruptible() if path.name in {RECORDING, PICTURE} else nullcontext():
            write(path)
    except KeyboardInterrupt:
        why = "interrupted"
    except OSError as error:
        why = error.strerror or str(error)
    except Exception as error:  # of a drawing or compressing library
        why = f"{type(error).__name__}: {error}"
    else:
        return ""
    path.unlink(missing_ok=True)
    return why


_PLACE, _TIME = "#7A7A7A", "#1C2430"
_PLACES = top_view.Style(_PLACE, size=2.5)
_ZONE = top_view.Style(palette.GOAL, opacity=0.13)
_START = top_view.Style("white", palette.START, width=1.6, label="start")
_END = top_view.Style(edge="#111111", width=1.4)
_ESTIMATE = top_view.Style(palette.ESTIMATE, width=0.9, dashed=True, label="estimate")
_CONTACT = top_view.Style(palette.CONTACT, "white", marker="cross", size=11.0, label="contact")

_BAD_OUTCOME, _GOOD_OUTCOME = "#B00020", "#2E7D32"

_LINE = 0.23
"""Distance of lines above the picture [inch]."""
_LETTER_WIDTH = 0.08
"""Mean width of a letter of the reason, with the margin [inch]."""
_BELOW = 0.95
"""Height of the room below the picture, for axis and legend [inch]."""

_TIME_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0)
"""Possible intervals between the times written beside the path [s]."""
_MAX_TIMES = 10
"""Largest number of times written beside the path."""
_DIRECTION_OVER = 0.5
"""Time before and after a point over which the direction of the path is taken [s]."""
_STANDING = 0.02
"""Length [m] up to which a part of the path has no direction."""


def draw_trajectory(result: MissionResult, path: Path) -> None:
    """Draw the picture of a run and write it as PNG to ``path``."""
    log, mission, movers = result.log, result.session.mission, result.movers
    outline, goals = outline_of(result.session.plan), [(goal.x, goal.y) for goal in mission.goals]
    shown = log.every(0.1)
    points = [log.true[:, :2], log.estimate[:, :2], np.array(goals)]
    at_start = np.array([mission.start.x, mission.start.y])
    low, high = outline.bounds(0.4, *points, at_start)
    width, height = high - low
    scale = min(11.0 / width, 8.0 / height)
    wide = max(8.5, width * scale) + 0.6
    header = _header(result, wide)
    above = 0.16 + _LINE * len(header)
    inches = max(3.0, height * scale) + _BELOW + above
    frame = (0.05, _BELOW / inches, 0.92, 1.0 - (_BELOW + above) / inches)
    figure, axes = plan_picture.plan_axes((wide, inches), frame, low, high)
    growing = result.session.stack.growth.growing_map
    if result.exploration is not None:
        plan_picture.draw_grown_grid(axes, growing.grid, zorder=2.5)
    places = np.array([(place.x, place.y) for place in mission.topo_map.places.values()])
    marks = top_view.Marks(places.reshape(-1, 2), _PLACES)
    plan_picture.draw_shapes(axes, [*outline.shapes(), marks], zorder=2.0)
    zones = [top_view.Disc(x, y, mission.spec.success.within, _ZONE) for x, y in goals]
    tracks = [] if movers is None else zip(movers.points.swapaxes(0, 1), movers.radii, strict=True)
    went = [
        shape
        for track, radius in tracks
        for shape in top_view.mover_shapes(track, (track[-1, 0], track[-1, 1]), radius, 0.35)
    ]
    plan_picture.draw_shapes(axes, [*went, *zones], zorder=3.0)
    if len(shown) > 1:
        leaders = [log.leaders[leader] for leader in log.leader[shown]]
        paths = top_view.led_lines(log.true[shown, :2], leaders)
        estimate = top_view.Line(log.estimate[shown, :2], _ESTIMATE)
        plan_picture.draw_shapes(axes, [*paths, estimate], zorder=4.0)
    plan_picture.draw_shapes(axes, _marks(result, goals), zorder=6.0)
    _write_labels(axes, result, goals)
    axes.set_xlabel("x [m]", fontsize=8, color="#666666", labelpad=1)
    axes.set_ylabel("y [m]", fontsize=8, color="#666666", labelpad=1)
    for number, (text, size, ink) in enumerate(header):
        weight = "bold" if number == 0 else "normal"
        y = 1.0 - (0.34 + _LINE * number) / inches
        figure.text(0.03, y, text, fontsize=size, color=ink, weight=weight)
    plan_picture.write_legend(figure, axes)
    figure.savefig(path, dpi=130, format="png", metadata={"Software": "navfw"})


def _header(result: MissionResult, wide: float) -> list[tuple[str, float, str]]:
    """The lines above the picture, with size [pt] and colour; ``wide`` is its width [inch]."""
    letters = int(wide / _LETTER_WIDTH)
    reason = textwrap.wrap(result.reason, letters, max_lines=3, placeholder=" ...") or [""]
    numbers = [
        f"{result.path_length_m:.1f} m in {result.sim_time_s:.1f} s",
        f"shortest {result.shortest_path_m:.1f} m, SPL {result.spl:.2f}",
        f"smallest clearance {result.min_clearance_m:.2f} m",
        f"final estimate error {result.estimate_error_m:.2f} m",
    ]
    if (explored := result.exploration) is not None:
        share = (
            f"{100.0 * explored.observed_share:.1f} % of {explored.reachable_m2:.0f} m2 observed"
        )
        numbers[1] = f"{share}, path {explored.path_over_tour:.2f} of a nearest-frontier tour"
    whole = "\xa0\xa0·  ".join(number.replace(" ", "\xa0") for number in numbers)  # wraps between
    title = f"{result.world} / {result.mission}, seed {result.seed}: {result.outcome}"
    return [
        (title, 13.0, _GOOD_OUTCOME if result.outcome.succeeded else _BAD_OUTCOME),
        *((line, 9.5, "#222222") for line in reason),
        *((line, 9.0, "#666666") for line in textwrap.wrap(whole, letters)),
    ]


def _marks(result: MissionResult, goals: Sequence[top_view.Point]) -> Iterator[top_view.Shape]:
    log, start = result.log, result.session.mission.start
    radius = result.session.mission.spec.robot.radius
    yield from top_view.robot_shapes(start, radius, 1.9 * radius, _START)
    if result.exploration is None:  # one of which has hundreds
        yield top_view.waypoint_marks((w.x, w.y) for w in log.waypoints if w.kind != "goal")
    yield top_view.goal_marks(goals)
    if log.ticks:
        yield top_view.Disc(log.true[-1, 0], log.true[-1, 1], radius, _END)
    yield top_view.Marks(np.array([(c.x, c.y) for c in log.contacts]).reshape(-1, 2), _CONTACT)


def _write_labels(axes: Axes, result: MissionResult, goals: Sequence[top_view.Point]) -> None:
    """Name the places of the way, goals first, and write times with arrows on the path."""
    log, mission = result.log, result.session.mission
    path = log.true[log.every(0.1), :2]
    if len(path):
        turn = np.linspace(0.0, 2.0 * math.pi, 13)
        body = mission.spec.robot.radius * np.column_stack([np.cos(turn), np.sin(turn)])
        path = np.vstack([path[0] + body, path, path[-1] + body])
    labels = plan_picture.PathLabels(axes, path, zorder=10)
    for waypoint in log.waypoints:
        labels.keep_clear((waypoint.x, waypoint.y))
    for contact in log.contacts[:1]:
        labels.write(contact.body, (contact.x, contact.y), palette.CONTACT)
    passed = {waypoint.place for waypoint in log.waypoints}
    places = {place.name: (place.x, place.y) for place in mission.topo_map.places.values()}
    named = [name for name, point in places.items() if point in goals]
    for name in dict.fromkeys((*named, *(name for name in places if name in passed))):
        labels.write(name, places[name], _PLACE)
    for tick in _timed_ticks(log):
        x, y, _ = log.true[tick]
        if labels.write(f"{log.time[tick]:.0f} s", (x, y), _TIME):
            plan_picture.draw_arrow(axes, (x, y), _direction(log, tick), _TIME, zorder=5.0)


def _timed_ticks(log: RunLog) -> list[int]:
    """Return the ticks at whole times, neither the first nor the last one."""
    if log.ticks < 2:
        return []
    step = next((s for s in _TIME_STEPS if log.time[-1] / s <= _MAX_TIMES), _TIME_STEPS[-1])
    times = np.arange(step, log.time[-1] - 0.3 * step, step)
    return [int(tick) for tick in np.searchsorted(log.time, times)]


def _direction(log: RunLog, tick: int) -> float:
    """Return the direction of the path [rad]; of the robot's nose where it stands."""
    now = log.time[tick]
    before, after = np.searchsorted(log.time, (now - _DIRECTION_OVER, now + _DIRECTION_OVER))
    dx, dy = log.true[min(after, log.ticks - 1), :2] - log.true[before, :2]
    if math.hypot(dx, dy) < _STANDING:
        return float(log.true[tick, 2])
    return math.atan2(dy, dx)
