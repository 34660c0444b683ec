"""The moments of a recorded run that its report shows, each with all that was newest at it."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from navfw.errors import ConfigError
from navfw.mofis.mofis import explanation_lines
from navfw.numerics import Array
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of
from navfw.recording.run_folder import RESULT
from navfw.recording.top_view import OutlineDisc, WorldOutline
from navfw.report.report_page import reduced_source
from navfw.signals import Pose

_MAX_ROWS = 4000
"""Largest number of rows; of a longer run every n-th command is taken."""
_OF_DAMAGED_MESSAGES = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


@dataclass(frozen=True, slots=True)
class RunTimeline:
    """The course of a run, one row per command (n rows), and the world that it went through.

    ``true`` and ``estimate`` (n, 2) [m] are positions in ``map``, ``leaders`` (n,) the leading
    behaviours, ``commands`` (n, 2) v [m/s] and w [rad/s]. ``clearance`` (n,) [m] is the distance of
    the robot's edge to walls and furniture, nan where none is known; ``confidence`` (n,) that of
    the position in [0, 1], nan where there is none. ``driven`` (n, 2) are the commands of whoever
    drove in the stack's stead, nan without. Where the true position is not known, ``true`` is the
    estimate.
    """

    time: Array
    true: Array
    estimate: Array
    leaders: tuple[str, ...]
    commands: Array
    clearance: Array
    confidence: Array
    driven: Array
    outline: WorldOutline


def read_timeline(run: RecordedRun, robot_radius: float) -> RunTimeline:
    """The course of ``run``; ``robot_radius`` [m] is subtracted from distances.

    Raises:
        ConfigError: the recording is damaged.

    """
    with located_damage(run, "a message"):
        outline = WorldOutline()
        nowhere = (math.nan, math.nan)
        true, estimate, driven = nowhere, nowhere, nowhere
        rows: list[tuple[float, ...]] = []
        leaders: list[str] = []
        wanted = (topics.WORLD, topics.TRUE_POSE, topics.POSE, topics.COMMAND, topics.DRIVEN)
        for message in run.messages(*wanted):
            content = message.content
            if message.topic == topics.WORLD:
                outline = _outline(content) if not outline.walls else outline
            elif message.topic == topics.TRUE_POSE:
                true = (content.pose.position.x, content.pose.position.y)
            elif message.topic == topics.POSE:
                estimate = (content.pose.position.x, content.pose.position.y)
            elif message.topic == topics.DRIVEN:
                driven = (content.twist.linear.x, content.twist.angular.z)
            else:
                confidence, v, w = content["confidence"], content["v"], content["w"]
                sure = math.nan if confidence is None else float(confidence)
                rows.append((message.time, *true, *estimate, float(v), float(w), sure, *driven))
                leaders.append(str(content["leader"]))
        step = max(1, math.ceil(len(rows) / _MAX_ROWS))
        table = np.array(rows[::step], dtype=np.float64).reshape(-1, 10)
        if np.isnan(table[:, 1:3]).all():
            table[:, 1:3] = table[:, 3:5]
        clearance = _clearance(table[:, 1:3], outline) - robot_radius
        return RunTimeline(
            time=table[:, 0],
            true=table[:, 1:3],
            estimate=table[:, 3:5],
            leaders=tuple(leaders[::step]),
            commands=table[:, 5:7],
            clearance=clearance,
            confidence=table[:, 7],
            driven=table[:, 8:],
            outline=outline,
        )


@contextmanager
def located_damage(run: RecordedRun, what: str) -> Iterator[None]:
    """Name the file of ``run`` where fields of ``what`` are missing, or have impossible values."""
    try:
        yield
    except (*_OF_DAMAGED_MESSAGES, cv2.error) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ConfigError(f"{what} is damaged ({reason})", file=run.path) from None


def robot_and_goals(result: Mapping[str, Any]) -> tuple[float, list[tuple[float, float]]]:
    """The robot's radius [m] and the goals (x, y) [m] in a result."""
    try:
        mission = result["config"]["mission"]
        goals = [(float(goal["x"]), float(goal["y"])) for goal in mission["goals"]]
        return float(mission["robot"]["radius"]), goals
    except (KeyError, TypeError, ValueError) as error:
        what = f"its configuration has no robot's radius or goals ({type(error).__name__}: {error})"
        raise ConfigError(what, file=RESULT) from None


def _outline(scene: Any) -> WorldOutline:
    """The world of ``viewer_messages.world_message`` from above."""
    entity = scene.entities[0]
    boxes = [(cube.size.z, _corners(cube)) for cube in entity.cubes]
    tall = max((height for height, _ in boxes), default=0.0)
    discs = [
        OutlineDisc(c.pose.position.x, c.pose.position.y, 0.5 * c.size.x) for c in entity.cylinders
    ]
    return WorldOutline(
        walls=[corners for height, corners in boxes if height == tall],
        furniture=[corners for height, corners in boxes if height != tall],
        discs=discs,
    )


def _corners(cube: Any) -> Array:
    """The corners (4, 2) [m] of a cube that is turned about its vertical axis."""
    half = 0.5 * np.array([cube.size.x, cube.size.y])
    around = half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return planar_pose(cube).points_to_parent(around)


def planar_pose(message: Any) -> Pose:
    """The planar pose in a transform, or in a message with a ``pose``, with covariance or not."""
    if hasattr(message, "translation"):
        place, turn = message.translation, message.rotation
    else:
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        place, turn = pose.position, pose.orientation
    return Pose(place.x, place.y, 2.0 * math.atan2(turn.z, turn.w))


def _clearance(points: Array, outline: WorldOutline) -> Array:
    """The distance [m] of each of ``points`` (n, 2) to the nearest object; nan without any."""
    contours = [
        np.asarray(corners, dtype=np.float32) for corners in (*outline.walls, *outline.furniture)
    ]
    nearest = np.full(len(points), math.inf)
    for row, (x, y) in enumerate(points.tolist()):
        away = [-cv2.pointPolygonTest(contour, (x, y), True) for contour in contours]
        away += [math.hypot(x - disc.x, y - disc.y) - disc.radius for disc in outline.discs]
        nearest[row] = min(away, default=math.inf)
    nearest[~np.isfinite(nearest)] = math.nan
    return nearest


_MAX_MOMENTS = 240
"""Largest number of moments of a report; of a longer run they are further apart."""

_MAX_TEXT = 8000
"""Largest length of the rules of a moment; what is longer is cut."""
_MAX_POINTS = 2000
"""Largest number of flow vectors and of cells of a moment."""
_WIDTH = 320
"""Width to which larger camera images are reduced [px]."""
_QUALITY = 75
"""Quality of the camera images (WebP), of 100."""


@dataclass(frozen=True, slots=True)
class Rating:
    """How each behaviour of ``names`` rates the commands (0 to 255).

    ``desirability``, ``prohibition`` (behaviours, speeds, turns) uint8; ``v`` [m/s] and ``w``
    [rad/s] are the first command and its step.
    """

    names: tuple[str, ...]
    desirability: npt.NDArray[np.uint8]
    prohibition: npt.NDArray[np.uint8]
    v: tuple[float, float]
    w: tuple[float, float]


@dataclass(slots=True)
class RunMoment:
    """What was known at ``time`` [s].

    ``image`` is a data URL of ``size`` (width, height) [px of the camera]. ``flow`` holds lines
    (x0, y0, x1, y1), ``cells`` groups of points (x, y) with their CSS colour, both in sixteenths of
    a pixel from the upper left corner. ``robot`` is its true position, ``way`` the points of the
    way ahead, x, y [m].
    """

    time: float
    image: str
    size: tuple[int, int]
    flow: list[int] = field(default_factory=list)
    cells: list[tuple[str, list[int]]] = field(default_factory=list)
    sentence: str = ""
    rules: str = ""
    command: dict[str, Any] = field(default_factory=dict)
    robot: tuple[float, float] | None = None
    way: list[tuple[float, float]] = field(default_factory=list)
    rating: Rating | None = None


def read_moments(run: RecordedRun, limit: int = _MAX_MOMENTS) -> list[RunMoment]:
    """At most ``limit`` moments of ``run``, evenly among the camera's images.

    Raises:
        ConfigError: the recording is damaged.

    """
    count = sum(1 for _ in run.messages(topics.CAMERA_IMAGE))
    kept = set(np.linspace(0, count - 1, min(count, limit)).round().astype(int).tolist())
    wanted = (
        topics.CAMERA_IMAGE,
        topics.FLOW,
        topics.CELLS,
        topics.PERCEPT,
        topics.COMMAND,
        topics.RULES,
        topics.PROPOSALS,
        topics.PATH,
        topics.TRUE_POSE,
    )
    moments: list[RunMoment] = []
    for newest in newest_at_images(run, wanted, kept):
        with located_damage(run, f"a message before {newest[topics.CAMERA_IMAGE].time:.2f} s"):
            moments.append(_moment(newest, run))
    return moments


def newest_at_images(
    run: RecordedRun, wanted: tuple[str, ...], kept: Container[int]
) -> Iterator[dict[str, RecordedMessage]]:
    """The newest message of each topic at the time of each image of ``kept``, the image included.

    Images stand later in the file than what was logged with them: they are packed meanwhile. The
    mapping is updated from image to image.
    """
    newest: dict[str, RecordedMessage] = {}
    others = run.messages(*(topic for topic in wanted if topic != topics.CAMERA_IMAGE))
    ahead = next(others, None)
    for number, image in enumerate(run.messages(topics.CAMERA_IMAGE)):
        while ahead is not None and ahead.time <= image.time + 1e-9:
            newest[ahead.topic] = ahead
            ahead = next(others, None)
        if number in kept:
            yield newest | {topics.CAMERA_IMAGE: image}


def _moment(newest: dict[str, RecordedMessage], run: RecordedRun) -> RunMoment:
    picture = newest[topics.CAMERA_IMAGE]
    image = image_of(picture, run.path)
    source = reduced_source(image, _WIDTH, _QUALITY)
    moment = RunMoment(picture.time, source, (image.shape[1], image.shape[0]))
    content = {topic: message.content for topic, message in newest.items()}
    if topics.FLOW in content:
        moment.flow = _points(content[topics.FLOW].points[0], 2 * _MAX_POINTS)
    if topics.CELLS in content:
        groups = content[topics.CELLS].points
        moment.cells = [(_css(g.outline_color), _points(g, _MAX_POINTS)) for g in groups]
    if topics.PERCEPT in content:
        moment.sentence = str(content[topics.PERCEPT]["sentence"])
    if topics.COMMAND in content:
        moment.command = dict(content[topics.COMMAND])
    if content.get(topics.RULES):
        moment.rules = "\n".join(explanation_lines(content[topics.RULES]))[:_MAX_TEXT]
    if topics.TRUE_POSE in content:
        position = content[topics.TRUE_POSE].pose.position
        moment.robot = (position.x, position.y)
    if topics.PATH in content:
        moment.way = [(p.position.x, p.position.y) for p in content[topics.PATH].poses]
    if topics.PROPOSALS in content:
        moment.rating = _rating(content[topics.PROPOSALS])
    return moment


def _points(group: Any, limit: int) -> list[int]:
    """The points of an annotation one after the other, in sixteenths of a pixel."""
    return [round(16.0 * value) for p in group.points[:limit] for value in (p.x, p.y)]


def _css(color: Any) -> str:
    parts = ", ".join(str(round(255.0 * share)) for share in (color.r, color.g, color.b))
    return f"rgba({parts}, {color.a:.2f})"


def _rating(grid: Any) -> Rating:
    """The ratings in a grid of ``viewer_messages.proposals_message``."""
    names = tuple(f.name.removesuffix(".desirability") for f in list(grid.fields)[::2])
    speeds, fields = int(grid.column_count), len(grid.fields)
    cells = np.frombuffer(grid.data, dtype=np.uint8).reshape(-1, speeds, fields)
    by_field = cells.transpose(2, 1, 0)
    first, step = grid.pose.position, grid.cell_size
    return Rating(names, by_field[::2], by_field[1::2], (first.x, step.x), (first.y, step.y))
