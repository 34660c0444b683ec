"""The moments of a recorded run that its report shows, each with all that was newest at it."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.errors import ConfigError
from navfw.mofis.explanation import explanation_lines
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of
from navfw.report.report_page import reduced_source

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
    a pixel from the upper left corner. ``true`` and ``estimate`` are poses (x, y, yaw), ``path``
    points (x, y) [m].
    """

    time: float
    image: str
    size: tuple[int, int]
    flow: list[int] = field(default_factory=list)
    cells: list[tuple[str, list[int]]] = field(default_factory=list)
    sentence: str = ""
    rules: str = ""
    command: dict[str, Any] = field(default_factory=dict)
    true: tuple[float, float] | None = None
    path: list[tuple[float, float]] = field(default_factory=list)
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
        try:
            moments.append(_moment(newest, run))
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            time = newest[topics.CAMERA_IMAGE].time
            what = f"a message before {time:.2f} s is damaged ({type(error).__name__}: {error})"
            raise ConfigError(what, file=run.path) from None
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
        moment.true = (position.x, position.y)
    if topics.PATH in content:
        moment.path = [(p.position.x, p.position.y) for p in content[topics.PATH].poses]
    if topics.PROPOSALS in content:
        moment.rating = _rating(content[topics.PROPOSALS])
    return moment


def _points(group: Any, limit: int) -> list[int]:
    """The points of an annotation one after the other, in sixteenths of a pixel."""
    return [round(16.0 * value) for p in group.points[:limit] for value in (p.x, p.y)]


def _css(color: Any) -> str:
    parts = ", ".join(str(round(255.0 * part)) for part in (color.r, color.g, color.b))
    return f"rgba({parts}, {color.a:.2f})"


def _rating(grid: Any) -> Rating:
    """The ratings in a grid of ``viewer_messages.proposals_message``."""
    names = tuple(f.name.removesuffix(".desirability") for f in list(grid.fields)[::2])
    speeds, fields = int(grid.column_count), len(grid.fields)
    cells = np.frombuffer(grid.data, dtype=np.uint8).reshape(-1, speeds, fields)
    by_field = cells.transpose(2, 1, 0)
    first, step = grid.pose.position, grid.cell_size
    return Rating(names, by_field[::2], by_field[1::2], (first.x, step.x), (first.y, step.y))
