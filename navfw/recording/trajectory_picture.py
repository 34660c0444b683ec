"""The picture of a run: true path coloured by leading behaviour, with times; what moved."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfw.recording.palette import CONTACT, ESTIMATE, GOAL, MOVING, START, behavior_color
from navfw.recording.path_labels import PathLabels
from navfw.recording.run_log import RunLog
from navfw.recording.top_view import (
    Point,
    WorldOutline,
    draw_arrow,
    draw_outline,
    style_axes,
    write_legend,
)
from navfw.signals import Array, Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PLACE, _TIME = "#7A7A7A", "#1C2430"

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
    outline: WorldOutline
    start: Pose
    goals: Sequence[Point]
    zone: float
    robot_radius: float
    places: Mapping[str, Point]
    tracks: Sequence[Array] = ()
    track_radii: Sequence[float] = ()


def draw_trajectory(path: Path, log: RunLog, picture: TrajectoryPicture) -> None:
    """Write the picture of ``log`` as PNG to ``path``."""
    # the object interface with the Agg canvas needs no window system and leaves pyplot's global
    # state to the calling program
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    low, high = _bounds(log, picture)
    width, height = high - low
    scale = min(11.0 / width, 8.0 / height)
    wide = max(8.5, width * scale) + 0.6
    header = _header(picture, wide)
    above = 0.16 + _LINE * len(header)
    inches = max(3.0, height * scale) + _BELOW + above
    figure = Figure(figsize=(wide, inches))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.05, _BELOW / inches, 0.92, 1.0 - (_BELOW + above) / inches))
    _draw_world(axes, picture)
    _draw_tracks(axes, picture)
    _draw_paths(axes, log)
    _draw_marks(axes, log, picture)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    _write_labels(axes, log, picture)
    style_axes(axes)
    axes.set_xlabel("x [m]", fontsize=8, color="#666666", labelpad=1)
    axes.set_ylabel("y [m]", fontsize=8, color="#666666", labelpad=1)
    for number, (text, size, ink) in enumerate(header):
        weight = "bold" if number == 0 else "normal"
        y = 1.0 - (0.34 + _LINE * number) / inches
        figure.text(0.03, y, text, fontsize=size, color=ink, weight=weight)
    write_legend(figure, axes)
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


def _bounds(log: RunLog, picture: TrajectoryPicture) -> tuple[Array, Array]:
    points = [log.true[:, :2], log.estimate[:, :2], np.array(picture.goals).reshape(-1, 2)]
    points += [np.array([[picture.start.x, picture.start.y]])]
    points += [*picture.outline.walls, *picture.outline.furniture]
    points += [
        np.array([[d.x - d.radius, d.y - d.radius], [d.x + d.radius, d.y + d.radius]])
        for d in picture.outline.discs
    ]
    together = np.vstack(points)
    margin = 0.4
    return together.min(axis=0) - margin, together.max(axis=0) + margin


def _draw_world(axes: Axes, picture: TrajectoryPicture) -> None:
    draw_outline(axes, picture.outline, edge=0.8, wall_edge=0.6)
    for x, y in picture.places.values():
        axes.plot(x, y, marker="o", ms=2.5, color=_PLACE, zorder=3)


def _draw_tracks(axes: Axes, picture: TrajectoryPicture) -> None:
    """The paths of moving obstacles, each with the obstacle at its end."""
    from matplotlib.patches import Circle

    for track, radius in zip(picture.tracks, picture.track_radii, strict=True):
        axes.plot(*track.T, color=MOVING, lw=1.6, alpha=0.7, label="moving obstacle", zorder=4)
        end = Circle((track[-1, 0], track[-1, 1]), radius, fc=MOVING, alpha=0.35, lw=0.0, zorder=4)
        axes.add_patch(end)


def _write_labels(axes: Axes, log: RunLog, picture: TrajectoryPicture) -> None:
    """Name the places of the way, goals first, and write times with arrows on the path."""
    path = log.true[log.every(0.1), :2]
    if len(path):
        turn = np.linspace(0.0, 2.0 * math.pi, 13)
        body = picture.robot_radius * np.column_stack([np.cos(turn), np.sin(turn)])
        path = np.vstack([path[0] + body, path, path[-1] + body])
    labels = PathLabels(axes, path, zorder=10)
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
            draw_arrow(axes, (x, y), _direction(log, tick), _TIME, zorder=6.5)


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


def _draw_paths(axes: Axes, log: RunLog) -> None:
    from matplotlib.collections import LineCollection

    shown = log.every(0.1)
    if len(shown) < 2:
        return
    true, estimate = log.true[shown, :2], log.estimate[shown, :2]
    segments = np.stack([true[:-1], true[1:]], axis=1)
    leader = log.leader[shown][1:]
    for index, name in enumerate(log.leaders):
        led = segments[leader == index]
        if not len(led):
            continue
        label = f"{name or 'standing'} ({100.0 * len(led) / len(segments):.0f} %)"
        lines = LineCollection(
            list(led), colors=behavior_color(name), linewidths=3.2, label=label, zorder=5
        )
        lines.set_capstyle("round")
        axes.add_collection(lines)
    axes.plot(*estimate.T, color=ESTIMATE, lw=0.9, ls=(0, (4, 2)), label="estimate", zorder=6)


def _draw_marks(axes: Axes, log: RunLog, picture: TrajectoryPicture) -> None:
    from matplotlib.patches import Circle

    start = picture.start
    body = Circle((start.x, start.y), picture.robot_radius, fc="white", ec=START, lw=1.6, zorder=7)
    axes.add_patch(body)
    nose = 1.9 * picture.robot_radius
    axes.plot(
        [start.x, start.x + nose * math.cos(start.yaw)],
        [start.y, start.y + nose * math.sin(start.yaw)],
        color=START,
        lw=1.6,
        label="start",
        zorder=7,
    )
    inner = [waypoint for waypoint in log.waypoints if waypoint.kind != "goal"]
    if inner:
        xs, ys = [w.x for w in inner], [w.y for w in inner]
        style = {"marker": "D", "ms": 5.5, "mfc": "none", "mec": GOAL, "mew": 1.1, "ls": ""}
        axes.plot(xs, ys, label="waypoint", zorder=7, **style)  # type: ignore[arg-type]
    for x, y in picture.goals:
        zone = Circle((x, y), picture.zone, fc=GOAL, ec=GOAL, alpha=0.13, lw=0.0, zorder=3)
        axes.add_patch(zone)
    xs, ys = [x for x, _ in picture.goals], [y for _, y in picture.goals]
    axes.plot(xs, ys, marker="*", ms=11, mfc=GOAL, mec="white", ls="", label="goal", zorder=8)
    if log.contacts:
        xs, ys = [c.x for c in log.contacts], [c.y for c in log.contacts]
        axes.plot(
            xs, ys, marker="X", ms=11, mfc=CONTACT, mec="white", ls="", zorder=9, label="contact"
        )
    if log.ticks:
        x, y, _ = log.true[-1]
        radius = picture.robot_radius
        end = Circle((x, y), radius, fc="none", ec="#111111", lw=1.4, zorder=8)
        axes.add_patch(end)
