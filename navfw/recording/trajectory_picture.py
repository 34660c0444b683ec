"""The picture of a run: true path coloured by leading behaviour, with times; what moved."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfw.numerics import Array
from navfw.recording import plan_picture, top_view
from navfw.recording.palette import CONTACT, ESTIMATE, GOAL, START
from navfw.recording.run_observers import RunLog
from navfw.signals import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PLACE, _TIME = "#7A7A7A", "#1C2430"
_PLACES = top_view.Style(_PLACE, size=2.5)
_ZONE = top_view.Style(GOAL, opacity=0.13)
_START = top_view.Style("white", START, width=1.6, label="start")
_END = top_view.Style(edge="#111111", width=1.4)
_ESTIMATE = top_view.Style(ESTIMATE, width=0.9, dashed=True, label="estimate")
_CONTACT = top_view.Style(CONTACT, "white", marker="cross", size=11.0, label="contact")

_BAD_OUTCOME, _GOOD_OUTCOME = "#B00020", "#2E7D32"

_LINE = 0.23
"""Distance of lines above the picture [inch]."""
_LETTER_WIDTH = 0.08
"""Mean width of a letter of the reason, with the margin [inch]."""
_BELOW = 0.95
"""Height of the room below the picture, for axis and legend [inch]."""

_TIME_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0)
"""Intervals between two times on the path [s]."""
_MAX_TIMES = 10
"""Largest number of times on the path."""
_DIRECTION_OVER = 0.5
"""Time over which the direction of the path is taken, each way [s]."""
_STANDING = 0.02
"""Length [m] up to which a part of the path has no direction."""


@dataclass(frozen=True, slots=True)
class TrajectoryPicture:
    """The content of the picture of a run, besides its log.

    ``title``, ``reason`` and ``numbers`` are its first lines; ``good`` sets the title's colour.
    ``places`` are those of the topological map; ``zone`` [m] is the radius of the success zone
    about each goal. ``tracks`` (k, 2) [m] are the paths of moving obstacles, ``track_radii`` [m]
    their radii.
    """

    title: str
    reason: str
    numbers: str
    good: bool
    outline: top_view.WorldOutline
    start: Pose
    goals: Sequence[top_view.Point]
    zone: float
    robot_radius: float
    places: Mapping[str, top_view.Point]
    tracks: Sequence[Array] = ()
    track_radii: Sequence[float] = ()


def draw_trajectory(path: Path, log: RunLog, picture: TrajectoryPicture) -> None:
    """Write the picture of ``log`` as PNG to ``path``."""
    shown = log.every(0.1)
    points = [log.true[:, :2], log.estimate[:, :2], np.array(picture.goals)]
    at_start = np.array([picture.start.x, picture.start.y])
    low, high = picture.outline.bounds(0.4, *points, at_start)
    width, height = high - low
    scale = min(11.0 / width, 8.0 / height)
    wide = max(8.5, width * scale) + 0.6
    header = _header(picture, wide)
    above = 0.16 + _LINE * len(header)
    inches = max(3.0, height * scale) + _BELOW + above
    frame = (0.05, _BELOW / inches, 0.92, 1.0 - (_BELOW + above) / inches)
    figure, axes = plan_picture.plan_axes((wide, inches), frame, low, high)
    places = np.array(list(picture.places.values())).reshape(-1, 2)
    plan_picture.draw_shapes(
        axes, [*picture.outline.shapes(), top_view.Marks(places, _PLACES)], zorder=2.0
    )
    zones = [top_view.Disc(x, y, picture.zone, _ZONE) for x, y in picture.goals]
    movers = [
        shape
        for track, radius in zip(picture.tracks, picture.track_radii, strict=True)
        for shape in top_view.mover_shapes(track, (track[-1, 0], track[-1, 1]), radius, 0.35)
    ]
    plan_picture.draw_shapes(axes, [*movers, *zones], zorder=3.0)
    if len(shown) > 1:
        leaders = [log.leaders[leader] for leader in log.leader[shown]]
        paths = top_view.led_lines(log.true[shown, :2], leaders)
        estimate = top_view.Line(log.estimate[shown, :2], _ESTIMATE)
        plan_picture.draw_shapes(axes, [*paths, estimate], zorder=4.0)
    plan_picture.draw_shapes(axes, _marks(log, picture), zorder=6.0)
    _write_labels(axes, log, picture)
    axes.set_xlabel("x [m]", fontsize=8, color="#666666", labelpad=1)
    axes.set_ylabel("y [m]", fontsize=8, color="#666666", labelpad=1)
    for number, (text, size, ink) in enumerate(header):
        weight = "bold" if number == 0 else "normal"
        y = 1.0 - (0.34 + _LINE * number) / inches
        figure.text(0.03, y, text, fontsize=size, color=ink, weight=weight)
    plan_picture.write_legend(figure, axes)
    figure.savefig(path, dpi=130, format="png", metadata={"Software": "navfw"})


def _header(picture: TrajectoryPicture, wide: float) -> list[tuple[str, float, str]]:
    """The lines above the picture, with size [pt] and colour; ``wide`` is its width [inch]."""
    letters = int(wide / _LETTER_WIDTH)
    reason = textwrap.wrap(picture.reason, letters, max_lines=3, placeholder=" ...") or [""]
    return [
        (picture.title, 13.0, _GOOD_OUTCOME if picture.good else _BAD_OUTCOME),
        *((line, 9.5, "#222222") for line in reason),
        (picture.numbers, 9.0, "#666666"),
    ]


def _marks(log: RunLog, picture: TrajectoryPicture) -> Iterator[top_view.Shape]:
    radius = picture.robot_radius
    yield from top_view.robot_shapes(picture.start, radius, 1.9 * radius, _START)
    yield top_view.waypoint_marks((w.x, w.y) for w in log.waypoints if w.kind != "goal")
    yield top_view.goal_marks(picture.goals)
    if log.ticks:
        yield top_view.Disc(log.true[-1, 0], log.true[-1, 1], radius, _END)
    yield top_view.Marks(np.array([(c.x, c.y) for c in log.contacts]).reshape(-1, 2), _CONTACT)


def _write_labels(axes: Axes, log: RunLog, picture: TrajectoryPicture) -> None:
    """Name the places of the way, goals first, and write times with arrows on the path."""
    path = log.true[log.every(0.1), :2]
    if len(path):
        turn = np.linspace(0.0, 2.0 * math.pi, 13)
        body = picture.robot_radius * np.column_stack([np.cos(turn), np.sin(turn)])
        path = np.vstack([path[0] + body, path, path[-1] + body])
    labels = plan_picture.PathLabels(axes, path, zorder=10)
    for waypoint in log.waypoints:
        labels.keep_clear((waypoint.x, waypoint.y))
    for contact in log.contacts[:1]:
        labels.write(contact.body, (contact.x, contact.y), CONTACT)
    passed = {waypoint.place for waypoint in log.waypoints}
    goals = [name for name, point in picture.places.items() if point in picture.goals]
    for name in dict.fromkeys((*goals, *(name for name in picture.places if name in passed))):
        labels.write(name, picture.places[name], _PLACE)
    for tick in _timed_ticks(log):
        x, y, _ = log.true[tick]
        if labels.write(f"{log.time[tick]:.0f} s", (x, y), _TIME):
            plan_picture.draw_arrow(axes, (x, y), _direction(log, tick), _TIME, zorder=5.0)


def _timed_ticks(log: RunLog) -> list[int]:
    """The ticks at whole times, neither the first nor the last one."""
    if log.ticks < 2:
        return []
    step = next((s for s in _TIME_STEPS if log.time[-1] / s <= _MAX_TIMES), _TIME_STEPS[-1])
    times = np.arange(step, log.time[-1] - 0.3 * step, step)
    return [int(tick) for tick in np.searchsorted(log.time, times)]


def _direction(log: RunLog, tick: int) -> float:
    """The direction of the path [rad]; of the robot's nose where it stands."""
    now = log.time[tick]
    before, after = np.searchsorted(log.time, (now - _DIRECTION_OVER, now + _DIRECTION_OVER))
    dx, dy = log.true[min(after, log.ticks - 1), :2] - log.true[before, :2]
    if math.hypot(dx, dy) < _STANDING:
        return float(log.true[tick, 2])
    return math.atan2(dy, dx)
