"""The plan beside the camera in the video of a run: local map, path, way ahead, what moves."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from navfw.perceive.lettering import write_key
from navfw.recording import channel_list as topics
from navfw.recording import palette
from navfw.report.plan_canvas import PlanCanvas
from navfw.report.run_timeline import RunTimeline
from navfw.signals import Array, Image, Pose

_KEY_HEIGHT = 70
"""Height of the key below the plan [px]."""
_SCALES = (36.0, 160.0)
"""Least and largest scale [px/m]; of a larger world the part around the robot is shown."""
_MARGIN = 0.4
"""Floor shown around the world [m]."""
_KNOWN = 0.04
"""Distance of an occupancy from one half from which a cell of the local map is shown."""
_STRENGTH = 1.3
"""Opacity of the local map per distance of the occupancy from one half."""
_PAPER, _INK = "#FFFFFF", "#1C1C24"


class VideoPlan:
    """Draws the plan of a run at one moment after the other, in ``size`` (width, height) [px].

    ``goals`` (x, y) and ``robot_radius`` are in metres.
    """

    def __init__(
        self,
        timeline: RunTimeline,
        goals: Sequence[tuple[float, float]],
        robot_radius: float,
        size: tuple[int, int],
    ) -> None:
        self._timeline = timeline
        self._goals = goals
        self._radius = robot_radius
        self._shape = (size[1], size[0], 3)
        outline = timeline.outline
        ends = [np.array([(d.x, d.y)]) + d.radius * np.array([[-1], [1]]) for d in outline.discs]
        corners = [*outline.walls, *outline.furniture, *ends, timeline.true, np.array(goals)]
        points = np.vstack([part.reshape(-1, 2) for part in corners])
        points = points[np.isfinite(points).all(axis=1)]
        self._low, self._high = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
        room = np.array([size[0], size[1] - _KEY_HEIGHT])
        fitting = float((room / (self._high - self._low)).min())
        self._scale = min(max(fitting, _SCALES[0]), _SCALES[1])
        self._half = 0.5 * room / self._scale
        changes = [
            n
            for n, pair in enumerate(itertools.pairwise(timeline.leaders), 1)
            if len(set(pair)) > 1
        ]
        self._pieces = list(itertools.pairwise([0, *changes, len(timeline.leaders)]))
        self._key = _key(timeline.leaders)

    def draw(self, time: float, content: Mapping[str, Any]) -> Image:
        """The plan at ``time`` [s]; ``content`` has what is newest on each channel."""
        image = np.full(self._shape, palette.bgr(_PAPER), dtype=np.uint8)
        write_key(
            image, self._key, (10.0, self._shape[0] - _KEY_HEIGHT + 22.0), 12.0, palette.bgr(_INK)
        )
        true = _planar(content.get(topics.TRUE_POSE))
        believed = _planar(content.get(topics.POSE))
        shown = image[: self._shape[0] - _KEY_HEIGHT]
        canvas = PlanCanvas(shown, self._corner(true or believed), self._scale)
        self._draw_world(canvas)
        if topics.TRANSFORMS in content:
            odom = _transform(content[topics.TRANSFORMS].transforms[0])
            _draw_local_map(canvas, content.get(topics.LOCAL_MAP), odom)
            _draw_obstacles(canvas, content.get(topics.OBSTACLES), odom)
        self._draw_path(canvas, time)
        self._draw_way(canvas, content, believed)
        for pose, fill in ((true, _PAPER), (believed, None)):
            if pose is not None:
                self._draw_robot(canvas, pose, fill)
        return image

    def _corner(self, pose: Pose | None) -> Array:
        """The lower left corner [m] of the part of the world around ``pose``."""
        low, high = self._low + self._half, self._high - self._half
        middle = 0.5 * (self._low + self._high)
        if pose is not None:
            middle = np.where(low < high, np.clip((pose.x, pose.y), low, high), middle)
        corner: Array = middle - self._half
        return corner

    def _draw_world(self, canvas: PlanCanvas) -> None:
        canvas.image[:] = palette.bgr(palette.FLOOR)
        outline = self._timeline.outline
        for corners in outline.furniture:
            canvas.polygon(corners, palette.FURNITURE)
        for disc in outline.discs:
            canvas.disc((disc.x, disc.y), disc.radius, palette.FURNITURE)
        for corners in outline.walls:
            canvas.polygon(corners, palette.WALL)

    def _draw_path(self, canvas: PlanCanvas, time: float) -> None:
        """The true path so far, in the colours of the leading behaviours."""
        until = int(np.searchsorted(self._timeline.time, time + 1e-6))
        for begin, end in self._pieces:
            points = self._timeline.true[max(begin - 1, 0) : min(end, until)]
            if len(points) > 1:
                canvas.line(points, palette.behavior_color(self._timeline.leaders[begin]), 4)

    def _draw_way(
        self, canvas: PlanCanvas, content: Mapping[str, Any], believed: Pose | None
    ) -> None:
        """Goals, the way ahead with its waypoints, and the local goal."""
        for goal in self._goals:
            canvas.mark(goal, palette.GOAL, cv2.MARKER_STAR, 18)
        if topics.PATH in content:
            way = [(p.position.x, p.position.y) for p in content[topics.PATH].poses]
            canvas.line(np.array(way), palette.GOAL, 1)
            for point in way[1:]:
                canvas.mark(point, palette.GOAL, cv2.MARKER_DIAMOND, 11)
        local_goal = _planar(content.get(topics.LOCAL_GOAL))
        if local_goal is not None and believed is not None:
            point = believed.to_parent(local_goal.x, local_goal.y)
            canvas.line(np.array([(believed.x, believed.y), point]), palette.LOCAL_GOAL, 2)
            canvas.disc(point, 0.08, palette.LOCAL_GOAL)

    def _draw_robot(self, canvas: PlanCanvas, pose: Pose, fill: str | None) -> None:
        """The robot with its nose; where it believes to be without ``fill``, as an outline."""
        if fill is not None:
            canvas.disc((pose.x, pose.y), self._radius, fill)
        canvas.disc((pose.x, pose.y), self._radius, palette.ESTIMATE, 1 if fill is None else 2)
        nose = pose.to_parent(1.4 * self._radius, 0.0)
        canvas.line(np.array([(pose.x, pose.y), nose]), palette.ESTIMATE, 1 if fill is None else 2)


def _key(leaders: Sequence[str]) -> list[tuple[str, tuple[int, int, int]]]:
    """What is drawn in the plan, with its colours."""
    key = [(name, palette.behavior_color(name)) for name in dict.fromkeys(leaders) if name]
    key += [
        ("mapped as free", palette.FREE),
        ("mapped as occupied", palette.OCCUPIED),
        ("way ahead", palette.GOAL),
        ("local goal", palette.LOCAL_GOAL),
        ("moving obstacle", palette.MOVING),
    ]
    return [(name, palette.bgr(color)) for name, color in key]


def _draw_local_map(canvas: PlanCanvas, grid: Any, odom: Pose) -> None:
    """Tint what the robot has mapped, by how sure it is."""
    if grid is None:
        return
    percent = np.frombuffer(grid.data, dtype=np.uint8).reshape(-1, grid.column_count)
    first, cell = grid.pose.position, grid.cell_size.x
    rows, columns = percent.shape
    middles = np.array([[0.5, 0.5], [columns - 0.5, 0.5], [0.5, rows - 0.5]])
    corners = odom.points_to_parent(cell * middles + (first.x, first.y))
    lean = percent / 100.0 - 0.5
    for side, color in ((lean, palette.OCCUPIED), (-lean, palette.FREE)):
        opacity = np.where(side > _KNOWN, np.minimum(_STRENGTH * side, 1.0), 0.0)
        canvas.tint(opacity, corners, color)


def _draw_obstacles(canvas: PlanCanvas, scene: Any, odom: Pose) -> None:
    """Moving obstacles that the robot tracks, with where each will be in a second."""
    for entity in () if scene is None else scene.entities:
        for body in entity.cylinders:
            at = odom.to_parent(body.pose.position.x, body.pose.position.y)
            canvas.disc(at, 0.5 * body.size.x, palette.MOVING)
        for line in entity.lines:
            ends = odom.points_to_parent(np.array([(p.x, p.y) for p in line.points]))
            canvas.line(ends, palette.MOVING, 2)


def _planar(message: Any) -> Pose | None:
    """The planar pose in a message with a pose; None without one."""
    if message is None:
        return None
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    return Pose(pose.position.x, pose.position.y, _yaw(pose.orientation))


def _transform(message: Any) -> Pose:
    """The planar pose of a transform's child frame."""
    return Pose(message.translation.x, message.translation.y, _yaw(message.rotation))


def _yaw(turn: Any) -> float:
    """The yaw [rad] of a quaternion about the vertical axis."""
    return 2.0 * math.atan2(turn.z, turn.w)
