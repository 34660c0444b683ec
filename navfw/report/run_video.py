"""The video of a recorded run: camera with flow and percept beside the plan."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.errors import ConfigError
from navfw.numerics import Array, Image
from navfw.perceive.overlay import text_width, wrap, write, write_key
from navfw.recording import channel_list as topics
from navfw.recording import palette, top_view
from navfw.recording.recorded_run import (
    RecordedMessage,
    RecordedRun,
    image_of,
    located_damage,
    open_run,
)
from navfw.recording.run_folder import read_result
from navfw.recording.video_output import VideoOutput
from navfw.report import run_timeline
from navfw.report.run_moments import (
    SHOWN,
    chase_picture,
    local_map_picture,
    moving_obstacles,
    newest_at_images,
)
from navfw.signals import Pose

_KEY_HEIGHT = 70
"""Height of the legend below the plan [px]."""
_SCALES = (30.0, 160.0)
"""Smallest and largest scale [px/m]; of a larger world only the part around the robot is shown."""
_BORDER = 0.4
"""Width of the floor shown around the world [m]."""
_WHITE = "#FFFFFF"
_PAPER, _INK, _FAINT = (255, 255, 255), (36, 28, 28), (117, 102, 91)
"""Blue, green and red of the background and of letters."""
_TRUE = top_view.Style(_WHITE, palette.ESTIMATE, width=1.6)
_BELIEVED = top_view.Style(edge=palette.ESTIMATE, width=0.8)
_PX_PER_PT = 1.25
"""Line width [px] per point of a style's width."""
_MARKERS = {"star": cv2.MARKER_STAR, "diamond": cv2.MARKER_DIAMOND}
_MARK_SIZE = 1.7
"""Size of OpenCV's marks [px] per point."""
_SHIFT = 4
"""Number of fractional bits of a coordinate in OpenCV's drawing."""


class VideoPlan:
    """Draws the plan of a run, one moment after the other, as pictures of ``size`` (width, height).

    ``goals`` (x, y) and ``robot_radius`` are in metres.
    """

    def __init__(
        self,
        timeline: run_timeline.RunTimeline,
        goals: Sequence[tuple[float, float]],
        robot_radius: float,
        size: tuple[int, int],
    ) -> None:
        self._timeline = timeline
        self._radius = robot_radius
        self._shape = (size[1], size[0], 3)
        self._world = timeline.outline.shapes()
        self._goals = top_view.goal_marks(goals)
        self._low, self._high = timeline.outline.bounds(_BORDER, timeline.true, np.array(goals))
        room = np.array([size[0], size[1] - _KEY_HEIGHT])
        fitting = float((room / (self._high - self._low)).min())
        self._scale = min(max(fitting, _SCALES[0]), _SCALES[1])
        self._half = 0.5 * room / self._scale
        self._room = int(room[1])
        self._key = _key(timeline.leaders)

    def draw(self, time: float, content: Mapping[str, Any]) -> Image:
        """Draw the plan at ``time`` [s]; ``content`` is the newest message of each channel."""
        image = np.full(self._shape, _PAPER, dtype=np.uint8)
        write_key(image, self._key, (10.0, self._shape[0] - _KEY_HEIGHT + 22.0), 12.0, _INK)
        true = run_timeline.newest_pose(content, topics.TRUE_POSE)
        believed = run_timeline.newest_pose(content, topics.POSE)
        canvas = _Canvas(image[: self._room], self._corner(true or believed), self._scale)
        canvas.image[:] = palette.bgr(palette.FLOOR)
        canvas.draw(self._world)
        if topics.TRANSFORMS in content:
            odom = run_timeline.planar_pose(content[topics.TRANSFORMS].transforms[0].transform)
            if topics.LOCAL_MAP in content:
                canvas.lay(content[topics.LOCAL_MAP], odom)
            if topics.OBSTACLES in content:
                for course in moving_obstacles(content[topics.OBSTACLES], odom):
                    canvas.draw(top_view.mover_shapes(*course))
        until = int(np.searchsorted(self._timeline.time, time + 1e-6))
        canvas.draw(top_view.led_lines(self._timeline.true[:until], self._timeline.leaders[:until]))
        canvas.draw([self._goals, *_way(content, believed)])
        for pose, style in ((true, _TRUE), (believed, _BELIEVED)):
            if pose is not None:
                canvas.draw(top_view.robot_shapes(pose, self._radius, 1.4 * self._radius, style))
        return image

    def _corner(self, pose: Pose | None) -> Array:
        """Return the lower left corner [m] of the part of the world around ``pose``."""
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

    def draw(self, shapes: Iterable[top_view.Shape]) -> None:
        """Draw ``shapes``, each over the one before, opaque."""
        for shape in shapes:
            fill, edge = shape.style.color, shape.style.edge
            width = max(1, round(_PX_PER_PT * shape.style.width))
            if isinstance(shape, top_view.Area):
                corners = [self._fixed(shape.corners)]
                cv2.fillPoly(self.image, corners, palette.bgr(fill), cv2.LINE_AA, _SHIFT)
                self._lines(corners, edge, width, closed=True)
            elif isinstance(shape, top_view.Line):
                measured = np.isfinite(shape.points).all(axis=1)
                runs = np.split(shape.points, np.flatnonzero(~measured))
                lines = [self._fixed(run[np.isfinite(run).all(axis=1)]) for run in runs]
                self._lines(lines, fill, width)
            elif isinstance(shape, top_view.Disc):
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

    def lay(self, grid: Any, odom: Pose) -> None:
        """Blend the local map of a message, in the frame ``odom``, over the image."""
        picture, first = local_map_picture(grid), grid.pose.position
        rows, columns = picture.shape[:2]
        cells = np.array([[0, 0], [columns - 1, 0], [0, rows - 1]], dtype=np.float32)
        corners = odom.points_to_parent(grid.cell_size.x * (cells + 0.5) + (first.x, first.y))
        turn = cv2.getAffineTransform(cells, self.pixels(corners).astype(np.float32))
        size = (self.image.shape[1], self.image.shape[0])
        shown = np.asarray(cv2.warpAffine(picture, turn, size, flags=cv2.INTER_NEAREST))
        at = np.nonzero(shown[..., 3])
        share = shown[at][:, 3:] / 255.0
        mixed = (1.0 - share) * self.image[at] + share * shown[at][:, :3]
        self.image[at] = np.rint(mixed).astype(np.uint8)

    def _fixed(self, points: Array) -> Any:
        """Points (n, 2) [m] as OpenCV's fixed-point coordinates."""
        return np.rint(self.pixels(points) * (1 << _SHIFT)).astype(np.int32)


def _key(leaders: Sequence[str]) -> list[tuple[str, tuple[int, int, int]]]:
    key = [(name, palette.behavior_color(name)) for name in dict.fromkeys(leaders) if name]
    key += [
        ("mapped as free", palette.FREE),
        ("mapped as occupied", palette.OCCUPIED),
        ("way ahead", palette.GOAL),
        ("local goal", palette.LOCAL_GOAL),
        ("moving obstacle", palette.MOVING),
    ]
    return [(name, palette.bgr(color)) for name, color in key]


def _way(content: Mapping[str, Any], believed: Pose | None) -> list[top_view.Shape]:
    if topics.PATH not in content:
        return []
    robot, *waypoints = [(p.position.x, p.position.y) for p in content[topics.PATH].poses]
    goal = run_timeline.newest_pose(content, topics.LOCAL_GOAL)
    point = None if goal is None or believed is None else believed.to_parent(goal.x, goal.y)
    return top_view.way_shapes(robot, waypoints, point)


_TEXT_HEIGHT = 240
"""Height of the text below the camera's image [px]."""
_LETTERS, _LINE = 15.0, 22
"""Size of letters, and distance of lines [px]."""
_MARGIN = 12


def draw_camera(
    time: float, image: Image, content: Mapping[str, Any], size: tuple[int, int]
) -> Image:
    """Draw the camera's ``image`` (height, width) at ``time`` [s], text below, in ``size`` [px].

    ``content`` is the newest message of each channel.
    """
    width, height = size
    panel = np.full((height, width, 3), _PAPER, dtype=np.uint8)
    shown = panel[: height - _TEXT_HEIGHT]
    shown[:] = _INK
    scale = min(shown.shape[1] / image.shape[1], shown.shape[0] / image.shape[0])
    wide, high = (round(scale * side) for side in image.shape[::-1])
    left, top = (shown.shape[1] - wide) // 2, (shown.shape[0] - high) // 2
    large = cv2.resize(image, (wide, high), interpolation=cv2.INTER_CUBIC)
    scene = shown[top : top + high, left : left + wide]
    scene[:] = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    if topics.FLOW in content:
        _draw_flow(scene, content[topics.FLOW], scale)
    if topics.CELLS in content:
        _draw_cells(scene, content[topics.CELLS], scale)
    _write_text(panel, height - _TEXT_HEIGHT, time, content)
    return panel


def _draw_cells(scene: Image, annotations: Any, scale: float) -> None:
    """Each flow cell as a dot in the colour of what it shows."""
    for group in annotations.points:
        fill = group.outline_color
        color = tuple(round(255.0 * part) for part in (fill.b, fill.g, fill.r))
        for at in _fixed(group, scale).tolist():
            for radius, ink in ((5, _INK), (4, color)):
                cv2.circle(scene, at, radius << _SHIFT, ink, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def _draw_flow(scene: Image, annotations: Any, scale: float) -> None:
    """Flow vectors as arrows from where each point was to where it is."""
    pairs = _fixed(annotations.points[0], scale).reshape(-1, 2, 2)
    for color, thickness in ((_INK, 4), (palette.bgr(palette.FLOW), 2)):
        for start, end in pairs.tolist():
            cv2.arrowedLine(scene, start, end, color, thickness, cv2.LINE_AA, _SHIFT, 0.3)


def _fixed(group: Any, scale: float) -> Any:
    """Return the points of an annotation as OpenCV's fixed-point coordinates (n, 2)."""
    points = np.array([(point.x, point.y) for point in group.points]).reshape(-1, 2)
    return np.rint(scale * points * (1 << _SHIFT)).astype(np.int32)


def _write_text(panel: Image, top: int, time: float, content: Mapping[str, Any]) -> None:
    """Time, command and its reason, the sentence, and the key of the image."""
    command = content.get(topics.COMMAND, {})
    leader = command.get("leader", "")
    drive = f"v {command['v']:+.2f} m/s   w {command['w']:+.2f} rad/s" if command else "no command"
    y, width = top + 28, panel.shape[1] - 2 * _MARGIN
    write(panel, f"{time:.1f} s", (_MARGIN, y), 18.0, _INK, bold=True)
    color = palette.bgr(palette.behavior_color(leader))
    cv2.rectangle(panel, (100, y - 14), (114, y), color, cv2.FILLED)
    write(panel, leader or "no behaviour", (122.0, y), 18.0, _INK, bold=True)
    write(
        panel, drive, (panel.shape[1] - _MARGIN - text_width(drive, _LETTERS), y), _LETTERS, _FAINT
    )
    y += 4
    sentence = content.get(topics.PERCEPT, {}).get("sentence", "")
    for text, most, ink in ((command.get("reason", ""), 2, _FAINT), (sentence, 5, _INK)):
        lines = wrap(text, _LETTERS, width)
        cut = [f"{lines[most - 1]} ..."] if len(lines) > most else lines[most - 1 : most]
        for line in (*lines[: most - 1], *cut):
            y += _LINE
            write(panel, line, (_MARGIN, y), _LETTERS, ink)
    key = [(name, palette.bgr(color)) for name, color in palette.camera_key()]
    write_key(panel, key, (float(_MARGIN), panel.shape[0] - 14.0), 12.0, _INK)


_SIZE = (640, 720)
"""Width and height of each half of a picture [px]."""
CHASE_SIZE = (640, 320)
"""Width and height of the view from behind, above the plan [px]."""
_MAX_AGE = 2.0
"""Age of a message from which on it is not shown [s]."""
_MAX_REPEATS = 600
"""Largest number of times that a picture is repeated while the camera gives no new one."""


def write_run_video(
    folder: Path,
    target: Path,
    option: str,
    progress: Callable[[int, int], None],
    chase: topics.Chase | None = None,
) -> None:
    """Write the recording in a run folder as a video to ``target``, one picture per camera image.

    ``option`` is the option that names ``target``. ``progress`` is called with the number of
    pictures so far and in total. ``chase`` draws the robot from behind, if its world is known.

    Raises:
        ConfigError: the folder has no recording, or its files are damaged.
        InputError: the video cannot be written (``VideoOutput``).

    """
    radius, goals = run_timeline.robot_and_goals(read_result(folder))
    run = open_run(folder, chase)
    timeline = run_timeline.read_timeline(run, radius)
    times = np.array([message.time for message in run.messages(topics.CAMERA_IMAGE)])
    if not len(times) or not len(timeline.time):
        raise ConfigError(
            "has no camera images or no commands; record the run again", file=run.path
        )
    plan = VideoPlan(timeline, goals, radius, (_SIZE[0], _SIZE[1] - CHASE_SIZE[1] * bool(chase)))
    rate = 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else 1.0  # the usual one
    repeats = np.clip(np.rint(np.diff(times, append=times[-1]) * rate), 1, _MAX_REPEATS)
    with VideoOutput(target, rate, option) as video:
        moments = newest_at_images(run, (*SHOWN, topics.LOCAL_GOAL), range(len(times)))
        for number, newest in enumerate(moments):
            picture = draw_moment(newest, plan, run)
            for _ in range(int(repeats[number])):
                video.add(picture)
            progress(number + 1, len(times))


def draw_moment(newest: dict[str, RecordedMessage], plan: VideoPlan, run: RecordedRun) -> Image:
    """Draw the picture of the ``newest`` messages at an image of ``run``."""
    camera = newest[topics.CAMERA_IMAGE]
    content = {
        topic: message.content
        for topic, message in newest.items()
        if camera.time - message.time < _MAX_AGE
    }
    with located_damage(run.path, f"a message before {camera.time:.2f} s"):
        left = draw_camera(camera.time, image_of(camera, run.path), content, _SIZE)
        right = plan.draw(camera.time, content)
        behind = chase_picture(run, content)
        right = right if behind is None else np.concatenate([behind, right])
        return np.concatenate([left, right], axis=1)
