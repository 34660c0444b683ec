"""Drawings of a run: the outline of its world, and an overlay in the simulator's window."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from navfw.recording import palette
from navfw.recording.top_view import Disc, Line, Marks, WorldOutline, way_shapes
from navfw.signals import Pose
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle

if TYPE_CHECKING:
    from navfw.missions.pilot import TickView
    from navfw.sim.engine import Point3, SimulatorWindow
    from navfw.sim.world_changes import Walker
    from navfw.stack import Stack

_LIFT = 0.03
"""Height of lines above the floor [m]."""
_POST = 0.5
"""Height of the posts at waypoints and at the local goal [m]."""
_STEP = 0.05
"""Length of the pieces of the path [m]."""


def outline_of(plan: SceneGeometry) -> WorldOutline:
    """Return the world's outline in top view: walls, doors, furniture and drops (``map``)."""
    discs = [solid.shape for solid in plan.solids if isinstance(solid.shape, Circle)]
    others = [solid for solid in plan.solids if not isinstance(solid.shape, Circle)]
    return WorldOutline(
        walls=[solid.shape.corners for solid in others if solid.kind in {"wall", "door"}],
        furniture=[s.shape.corners for s in others if s.kind in {"box", "mesh", "drop"}],
        discs=[(disc.x, disc.y, disc.radius) for disc in discs],
    )


def discs_of(walkers: Iterable[Walker]) -> list[tuple[float, float, float]]:
    """Return the walkers' present positions as discs x, y, radius [m] in ``map``."""
    return [(walker.x, walker.y, walker.spec.radius) for walker in walkers]


class WindowOverlay:
    """Draws a run of ``stack`` into the simulator's ``window``, whose camera follows the robot.

    The driven path is the true one, in the colours of the leading behaviours; the route ahead and
    the local goal are drawn where the robot believes them to be.
    """

    def __init__(self, window: SimulatorWindow, stack: Stack) -> None:
        self._window = window
        self._stack = stack
        self._drawn: Pose | None = None
        self._lines: dict[str, list[Point3]] = {}

    def draw(self, tick: TickView) -> None:
        """Update the drawing, if ``tick`` has a camera frame."""
        if tick.image is None:
            return
        pose = Pose(*tick.true_pose.tolist())
        self._window.follow(pose.x, pose.y)
        self._draw_path(pose)
        self._draw_way()
        command = self._stack.state.command
        does = "no command" if command is None else f"{command.leader}: {command.reason}"
        self._window.say(f"{tick.time:.1f} s  {does}")

    def _draw_path(self, pose: Pose) -> None:
        last = self._drawn
        if last is None:
            self._drawn = pose
        elif math.hypot(pose.x - last.x, pose.y - last.y) >= _STEP:
            command = self._stack.state.command
            leader = "" if command is None else command.leader
            ends = (last.x, last.y, _LIFT), (pose.x, pose.y, _LIFT)
            self._window.extend(*ends, palette.rgb(palette.behavior_color(leader)))
            self._drawn = pose

    def _draw_way(self) -> None:
        state, context = self._stack.state, self._stack.mofis.context
        if state.belief is None:
            return
        robot, point = state.belief.pose, None
        if state.command is not None and context is not None and context.local_goal is not None:
            point = robot.to_parent(context.local_goal.x, context.local_goal.y)
        way = [(waypoint.x, waypoint.y) for waypoint in state.path]
        for shape in way_shapes((robot.x, robot.y), way, point):
            name, color = shape.style.label, palette.rgb(shape.style.color or shape.style.edge)
            if isinstance(shape, Line):
                self._draw(name, [(x, y, _LIFT) for x, y in shape.points.tolist()], color)
            elif isinstance(shape, Disc):
                self._draw(f"{name} post", _post(shape.x, shape.y), color)
            elif isinstance(shape, Marks):
                for number, (x, y) in enumerate(shape.points.tolist()):
                    self._draw(f"post {number}", _post(x, y), color)

    def _draw(self, name: str, points: list[Point3], color: tuple[int, int, int]) -> None:
        """Draw a line in place of the last one of this ``name``, if it is another one."""
        if self._lines.get(name) != points:
            self._lines[name] = points
            self._window.draw(name, points, color)


def _post(x: float, y: float) -> list[Point3]:
    return [(x, y, _LIFT), (x, y, _POST)]
