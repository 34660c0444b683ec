"""The plan beside the camera in the video of a run: local map, path, way ahead, what moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from navfw.numerics import Array, Image
from navfw.perceive.lettering import write_key
from navfw.recording import channel_list as topics
from navfw.recording import palette
from navfw.recording.top_view import (
    Area,
    Disc,
    Line,
    Shape,
    Style,
    goal_marks,
    led_lines,
    mover_shapes,
    robot_shapes,
    way_shapes,
)
from navfw.report.run_moments import RunTimeline, planar_pose
from navfw.signals import Pose

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
_TRUE = Style(_PAPER, palette.ESTIMATE, width=1.6)
_BELIEVED = Style(edge=palette.ESTIMATE, width=0.8)
_PX_PER_PT = 1.25
"""Width of lines [px] per point."""
_MARKERS = {"star": cv2.MARKER_STAR, "diamond": cv2.MARKER_DIAMOND}
_MARK_SIZE = 1.7
"""Size of OpenCV's marks [px] per point."""
_SHIFT = 4
"""Bits of a pixel's fraction in OpenCV's drawing."""


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
        self._radius = robot_radius
        self._shape = (size[1], size[0], 3)
        self._world = timeline.outline.shapes()
        self._goals = goal_marks(goals)
        self._low, self._high = timeline.outline.bounds(_MARGIN, timeline.true, np.array(goals))
        room = np.array([size[0], size[1] - _KEY_HEIGHT])
        fitting = float((room / (self._high - self._low)).min())
        self._scale = min(max(fitting, _SCALES[0]), _SCALES[1])
        self._half = 0.5 * room / self._scale
        self._key = _key(timeline.leaders)

    def draw(self, time: float, content: Mapping[str, Any]) -> Image:
        """The plan at ``time`` [s]; ``content`` has what is newest on each channel."""
        image = np.full(self._shape, palette.bgr(_PAPER), dtype=np.uint8)
        write_key(
            image, self._key, (10.0, self._shape[0] - _KEY_HEIGHT + 22.0), 12.0, palette.bgr(_INK)
        )
        true = _pose(content, topics.TRUE_POSE)
        believed = _pose(content, topics.POSE)
        shown = image[: self._shape[0] - _KEY_HEIGHT]
        canvas = _Canvas(shown, self._corner(true or believed), self._scale)
        canvas.image[:] = palette.bgr(palette.FLOOR)
        canvas.draw(self._world)
        if topics.TRANSFORMS in content:
            odom = planar_pose(content[topics.TRANSFORMS].transforms[0])
            _draw_local_map(canvas, content.get(topics.LOCAL_MAP), odom)
            canvas.draw(_movers(content.get(topics.OBSTACLES), odom))
        until = int(np.searchsorted(self._timeline.time, time + 1e-6))
        canvas.draw(led_lines(self._timeline.true[:until], self._timeline.leaders[:until]))
        canvas.draw([self._goals, *_way(content, believed)])
        for pose, style in ((true, _TRUE), (believed, _BELIEVED)):
            if pose is not None:
                canvas.draw(robot_shapes(pose, self._radius, 1.4 * self._radius, style))
        return image

    def _corner(self, pose: Pose | None) -> Array:
        """The lower left corner [m] of the part of the world around ``pose``."""
        low, high = self._low + self._half, self._high - self._half
        middle = 0.5 * (self._low + self._high)
        if pose is not None:
            middle = np.where(low < high, np.clip((pose.x, pose.y), low, high), middle)
        corner: Array = middle - self._half
        return corner


class _Canvas:
    """Draws into ``image``; ``corner`` (2,) [m] is at its lower left, ``scale`` is in px/m.

    Colours are ``#RRGGBB``.
    """

    def __init__(self, image: Image, corner: Array, scale: float) -> None:
        self.image = image
        self._corner = corner
        self._scale = scale

    def pixels(self, points: Array) -> Array:
        """Points (n, 2) [m] as pixels (n, 2)."""
        x, y = ((np.reshape(points, (-1, 2)) - self._corner) * self._scale).T
        return np.column_stack([x, self.image.shape[0] - y])

    def draw(self, shapes: Iterable[Shape]) -> None:
        """Draw ``shapes``, each over the one before, opaque."""
        for shape in shapes:
            fill, edge = shape.style.color, shape.style.edge
            width = max(1, round(_PX_PER_PT * shape.style.width))
            if isinstance(shape, Area):
                corners = [self._fixed(shape.corners)]
                cv2.fillPoly(self.image, corners, palette.bgr(fill), cv2.LINE_AA, _SHIFT)
                self._lines(corners, edge, width, closed=True)
            elif isinstance(shape, Line):
                measured = np.isfinite(shape.points).all(axis=1)
                runs = np.split(shape.points, np.flatnonzero(~measured))
                lines = [self._fixed(run[np.isfinite(run).all(axis=1)]) for run in runs]
                self._lines(lines, fill, width)
            elif isinstance(shape, Disc):
                (middle,) = self._fixed(np.array([shape.x, shape.y])).tolist()
                radius = round(shape.radius * self._scale * (1 << _SHIFT))
                for color, thick in ((fill, cv2.FILLED), (edge, width)):
                    if color:
                        ink = palette.bgr(color)
                        cv2.circle(self.image, middle, radius, ink, thick, cv2.LINE_AA, _SHIFT)
            else:
                kind, size = _MARKERS[shape.style.marker], round(_MARK_SIZE * shape.style.size)
                for at in np.rint(self.pixels(shape.points)).astype(int).tolist():
                    ink = palette.bgr(fill or edge)
                    cv2.drawMarker(self.image, at, ink, kind, size, 2, cv2.LINE_AA)

    def _lines(self, lines: list[Any], color: str, width: int, *, closed: bool = False) -> None:
        ink = palette.bgr(color)
        cv2.polylines(self.image, lines, closed, ink, width, cv2.LINE_AA, _SHIFT)

    def tint(self, opacity: Array, corners: Array, color: str) -> None:
        """Blend a grid of opacities (rows, columns) in [0, 1] over the image.

        ``corners`` (3, 2) [m] are the middles of its cells [0, 0], [0, columns - 1], [rows - 1, 0].
        """
        rows, columns = opacity.shape
        cells = np.array([[0, 0], [columns - 1, 0], [0, rows - 1]], dtype=np.float32)
        seen = self.pixels(corners).astype(np.float32)
        size = (self.image.shape[1], self.image.shape[0])
        turn = cv2.getAffineTransform(cells, seen)
        shown = cv2.warpAffine(
            opacity.astype(np.float32), turn, size, flags=cv2.INTER_NEAREST, borderValue=0.0
        )
        at = np.nonzero(shown)
        share = np.asarray(shown)[at][:, None]
        mixed = (1.0 - share) * self.image[at] + share * np.array(palette.bgr(color))
        self.image[at] = np.rint(mixed).astype(np.uint8)

    def _fixed(self, points: Array) -> Any:
        """Points (n, 2) [m] as OpenCV's fixed-point coordinates."""
        return np.rint(self.pixels(points) * (1 << _SHIFT)).astype(np.int32)


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


def _draw_local_map(canvas: _Canvas, grid: Any, odom: Pose) -> None:
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


def _movers(scene: Any, odom: Pose) -> Iterator[Shape]:
    """Moving obstacles that the robot tracks, with where each will be in a second."""
    for entity in () if scene is None else scene.entities:
        for body, line in zip(entity.cylinders, entity.lines, strict=True):
            at = odom.to_parent(body.pose.position.x, body.pose.position.y)
            ends = odom.points_to_parent(np.array([(p.x, p.y) for p in line.points]))
            yield from mover_shapes(ends, at, 0.5 * body.size.x)


def _way(content: Mapping[str, Any], believed: Pose | None) -> list[Shape]:
    """The way ahead with its waypoints, and the local goal."""
    if topics.PATH not in content:
        return []
    robot, *waypoints = [(p.position.x, p.position.y) for p in content[topics.PATH].poses]
    goal = _pose(content, topics.LOCAL_GOAL)
    point = None if goal is None or believed is None else believed.to_parent(goal.x, goal.y)
    return way_shapes(robot, waypoints, point)


def _pose(content: Mapping[str, Any], topic: str) -> Pose | None:
    """The newest pose on a channel; None without one."""
    return planar_pose(content[topic]) if topic in content else None
