"""The picture of a run: true path coloured by leading behaviour, estimated path, contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfw.recording.behavior_colors import behavior_colors
from navfw.recording.run_log import RunLog
from navfw.recording.top_view import Point, WorldOutline, draw_names, draw_outline, style_axes
from navfw.signals import Array, Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["TrajectoryPicture", "draw_trajectory"]

_ESTIMATE, _PLACE, _START, _GOAL, _CONTACT = "#303030", "#7A7A7A", "#2E7D32", "#B0004E", "#D00000"

_BAD_OUTCOME, _GOOD_OUTCOME = "#B00020", "#2E7D32"

_LEGEND_WIDTH = 1.25
"""Mean width of an entry of the legend [inch]."""


@dataclass(frozen=True, slots=True)
class TrajectoryPicture:
    """The content of the picture of a run, besides its log.

    ``title``, ``reason`` and ``numbers`` are its first lines; ``good`` sets the title's colour.
    ``places`` are those of the topological map; ``zone`` [m] is the radius of the success zone
    about each goal.
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


def draw_trajectory(path: Path, log: RunLog, picture: TrajectoryPicture) -> None:
    """Write the picture of ``log`` as PNG to ``path``."""
    # the object interface with the Agg canvas needs no window system and leaves pyplot's global
    # state to the calling program
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    low, high = _bounds(log, picture)
    width, height = high - low
    scale = min(11.0 / width, 8.0 / height)
    inches = max(3.0, height * scale) + 1.8
    figure = Figure(figsize=(max(8.5, width * scale) + 0.6, inches))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.05, 0.95 / inches, 0.92, 1.0 - 1.8 / inches))
    _draw_world(axes, picture)
    _draw_paths(axes, log)
    _draw_marks(axes, log, picture)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    _draw_names(axes, log, picture)
    style_axes(axes)
    axes.set_xlabel("x [m]", fontsize=8, color="#666666", labelpad=1)
    axes.set_ylabel("y [m]", fontsize=8, color="#666666", labelpad=1)
    _write_header(figure, picture, inches)
    _write_legend(figure, axes)
    figure.savefig(path, dpi=130, format="png", metadata={"Software": "navfw"})


def _write_header(figure: Figure, picture: TrajectoryPicture, inches: float) -> None:
    color = _GOOD_OUTCOME if picture.good else _BAD_OUTCOME
    lines = ((picture.title, 13, color), (picture.reason, 9.5, "#222222"))
    for number, (text, size, ink) in enumerate((*lines, (picture.numbers, 9, "#666666"))):
        weight = "bold" if number == 0 else "normal"
        y = 1.0 - (0.34 + 0.23 * number) / inches
        figure.text(0.03, y, text, fontsize=size, color=ink, weight=weight)


def _write_legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    in_a_row = max(1, int(figure.get_figwidth() / _LEGEND_WIDTH))
    figure.legend(
        handles,
        labels,
        loc="lower center",
        ncols=math.ceil(len(labels) / math.ceil(len(labels) / in_a_row)),
        columnspacing=1.4,
        fontsize=8,
        frameon=False,
    )


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


def _draw_names(axes: Axes, log: RunLog, picture: TrajectoryPicture) -> None:
    """Write the names of places: goals and waypoints first, then short names first."""
    passed = {waypoint.place for waypoint in log.waypoints}

    def rank(name: str) -> tuple[bool, int]:
        return picture.places[name] not in picture.goals and name not in passed, len(name)

    places = {name: picture.places[name] for name in sorted(picture.places, key=rank)}
    draw_names(axes, places, _PLACE, zorder=7)


def _draw_paths(axes: Axes, log: RunLog) -> None:
    from matplotlib.collections import LineCollection

    shown = log.every(0.1)
    if len(shown) < 2:
        return
    true, estimate = log.true[shown, :2], log.estimate[shown, :2]
    segments = np.stack([true[:-1], true[1:]], axis=1)
    leader = log.leader[shown][1:]
    for index, (name, color) in enumerate(behavior_colors(log.leaders).items()):
        led = segments[leader == index]
        if not len(led):
            continue
        label = f"{name or 'standing'} ({100.0 * len(led) / len(segments):.0f} %)"
        lines = LineCollection(list(led), colors=color, linewidths=3.2, label=label, zorder=5)
        lines.set_capstyle("round")
        axes.add_collection(lines)
    axes.plot(*estimate.T, color=_ESTIMATE, lw=0.9, ls=(0, (4, 2)), label="estimate", zorder=6)


def _draw_marks(axes: Axes, log: RunLog, picture: TrajectoryPicture) -> None:
    from matplotlib.patches import Circle

    start = picture.start
    body = Circle((start.x, start.y), picture.robot_radius, fc="white", ec=_START, lw=1.6, zorder=7)
    axes.add_patch(body)
    nose = 1.9 * picture.robot_radius
    axes.plot(
        [start.x, start.x + nose * math.cos(start.yaw)],
        [start.y, start.y + nose * math.sin(start.yaw)],
        color=_START,
        lw=1.6,
        label="start",
        zorder=7,
    )
    inner = [waypoint for waypoint in log.waypoints if waypoint.kind != "goal"]
    if inner:
        xs, ys = [w.x for w in inner], [w.y for w in inner]
        style = {"marker": "D", "ms": 5.5, "mfc": "none", "mec": _GOAL, "mew": 1.1, "ls": ""}
        axes.plot(xs, ys, label="waypoint", zorder=7, **style)  # type: ignore[arg-type]
    for x, y in picture.goals:
        zone = Circle((x, y), picture.zone, fc=_GOAL, ec=_GOAL, alpha=0.13, lw=0.0, zorder=3)
        axes.add_patch(zone)
    xs, ys = [x for x, _ in picture.goals], [y for _, y in picture.goals]
    axes.plot(xs, ys, marker="*", ms=11, mfc=_GOAL, mec="white", ls="", label="goal", zorder=8)
    if log.contacts:
        xs, ys = [c.x for c in log.contacts], [c.y for c in log.contacts]
        axes.plot(
            xs, ys, marker="X", ms=11, mfc=_CONTACT, mec="white", ls="", zorder=9, label="contact"
        )
        axes.annotate(
            log.contacts[0].body,
            (log.contacts[0].x, log.contacts[0].y),
            xytext=(8, -11),
            textcoords="offset points",
            fontsize=8,
            color=_CONTACT,
            zorder=9,
        )
    if log.ticks:
        x, y, _ = log.true[-1]
        radius = picture.robot_radius
        end = Circle((x, y), radius, fc="none", ec="#111111", lw=1.4, zorder=8)
        axes.add_patch(end)
