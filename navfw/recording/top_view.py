"""Describe a plan in top view as a list of shapes in metres, for all programs that draw it.

Pictures draw shapes with matplotlib, pages on a canvas, videos with OpenCV, recordings as messages
of Foxglove, and the simulator's window as lines.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from navfw.numerics import Array
from navfw.recording import palette
from navfw.signals import Pose

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Style:
    """The look of a shape.

    ``color`` fills areas, discs and marks ("" leaves them empty) and is the colour of lines;
    ``edge`` is that of outlines, "" for none. ``width`` is that of lines and outlines [pt];
    ``opacity`` is in [0, 1]. ``marker`` names a mark's shape, as "star", ``size`` is that of marks
    [pt]; ``height`` [m] is that of a body in a scene. ``label`` names the shape in keys.
    """

    color: str = ""
    edge: str = ""
    width: float = 1.0
    opacity: float = 1.0
    dashed: bool = False
    marker: str = "circle"
    size: float = 5.0
    height: float = 0.0
    label: str = ""


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon with ``corners`` (k, 2) [m]."""

    corners: Array
    style: Style


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc of ``radius`` about (x, y) [m]."""

    x: float
    y: float
    radius: float
    style: Style


@dataclass(frozen=True, slots=True)
class Line:
    """The line through ``points`` (n, 2) [m]; a row of nan interrupts it."""

    points: Array
    style: Style


@dataclass(frozen=True, slots=True)
class Marks:
    """Marks at ``points`` (n, 2) [m], whose size on paper does not depend on the scale."""

    points: Array
    style: Style


Shape = Area | Disc | Line | Marks

_WALL = Style(palette.WALL, palette.WALL, width=0.6, height=2.0)
_FURNITURE = Style(palette.FURNITURE, palette.EDGE, width=0.8, height=0.7)
"""Heights are those in a scene: the outline has none."""
_GOAL = Style(palette.GOAL, "white", marker="star", size=11.0, label="goal")
_WAY = Style(palette.GOAL, width=0.8, label="way")
_WAYPOINT = Style(edge=palette.GOAL, width=1.1, marker="diamond", size=5.5, label="waypoint")
_LOCAL_GOAL = Style(palette.LOCAL_GOAL, width=1.6, label="local goal")
_LOCAL_GOAL_RADIUS = 0.08
MOVER = Style(palette.MOVING, width=1.6, height=1.0, label="moving obstacle")


@dataclass(frozen=True, slots=True)
class WorldOutline:
    """A world in top view: polygons (k, 2) and discs (x, y, radius) [m] in ``map``."""

    walls: Sequence[Array] = ()
    furniture: Sequence[Array] = ()
    discs: Sequence[tuple[float, float, float]] = ()

    def shapes(self) -> list[Shape]:
        """Return the shapes of the furniture, and those of the walls over it."""
        return [
            *(Area(corners, _FURNITURE) for corners in self.furniture),
            *(Disc(*disc, _FURNITURE) for disc in self.discs),
            *(Area(corners, _WALL) for corners in self.walls),
        ]

    def bounds(self, margin: float, *others: Array) -> tuple[Array, Array]:
        """Return least and largest x, y [m] of world and ``others`` (n, 2), plus a ``margin``."""
        ends = np.array([(-1.0, -1.0), (1.0, 1.0)])
        round_ends = [np.array([x, y]) + radius * ends for x, y, radius in self.discs]
        corners = [*self.walls, *self.furniture, *round_ends, *others]
        points = np.vstack([corner_points.reshape(-1, 2) for corner_points in corners])
        points = points[np.isfinite(points).all(axis=1)]
        return points.min(axis=0) - margin, points.max(axis=0) + margin


def led_lines(points: Array, leaders: Sequence[str]) -> list[Line]:
    """Return the path through ``points`` (n, 2), one line for each of the ``leaders`` (n,).

    A piece has the colour of the behaviour that leads at its end; labels give shares.
    """
    names = np.array(leaders[1:], dtype=object)
    lines = []
    for name in dict.fromkeys(leaders[1:]):
        led = names == name
        ends = np.flatnonzero(np.append(led, False) | np.insert(led, 0, False))
        gaps = 1 + np.flatnonzero(~led[ends[:-1]])
        label = f"{name or 'standing'} ({100.0 * led.mean():.0f} %)"
        style = Style(palette.behavior_color(name), width=3.2, label=label)
        lines.append(Line(np.insert(points[ends], gaps, np.nan, axis=0), style))
    return lines


def goal_marks(goals: Iterable[Point]) -> Marks:
    """Return the marks of a mission's goals."""
    return Marks(np.array(list(goals)).reshape(-1, 2), _GOAL)


def waypoint_marks(points: Iterable[Point]) -> Marks:
    """Return the marks of the planner's waypoints."""
    return Marks(np.array(list(points)).reshape(-1, 2), _WAYPOINT)


def way_shapes(robot: Point, waypoints: Sequence[Point], local_goal: Point | None) -> list[Shape]:
    """Return the shapes of the route from the ``robot`` over ``waypoints``, and the local goal."""
    shapes: list[Shape] = [
        Line(np.array([robot, *waypoints[:1]]), replace(_WAY, label="first leg")),
        Line(np.array(waypoints).reshape(-1, 2), _WAY),
        waypoint_marks(waypoints),
    ]
    if local_goal is not None:
        shapes.append(Line(np.array([robot, local_goal]), _LOCAL_GOAL))
        shapes.append(Disc(*local_goal, _LOCAL_GOAL_RADIUS, _LOCAL_GOAL))
    return shapes


def mover_shapes(line: Array, at: Point, radius: float, opacity: float = 1.0) -> list[Shape]:
    """Return a moving obstacle of ``radius`` [m] at a point, and the ``line`` (n, 2) it takes."""
    return [
        Line(line, replace(MOVER, opacity=min(2.0 * opacity, 1.0))),
        Disc(*at, radius, replace(MOVER, opacity=opacity, label="")),
    ]


def robot_shapes(pose: Pose, radius: float, nose: float, style: Style) -> list[Shape]:
    """Return the robot as a disc, and a line from its middle to its ``nose`` [m] ahead of it."""
    tip = pose.to_parent(nose, 0.0)
    return [
        Disc(pose.x, pose.y, radius, replace(style, label="")),
        Line(np.array([(pose.x, pose.y), tip]), replace(style, color=style.edge)),
    ]
