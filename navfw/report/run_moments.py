"""The moments of a recorded run that its report shows, each with the newest of all messages."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.mofis.explanation_text import explanation_lines
from navfw.numerics import Array, Image
from navfw.recording import channel_list as topics
from navfw.recording import palette
from navfw.recording.recorded_run import RecordedMessage, RecordedRun, image_of, located_damage
from navfw.report.report_page import reduced_source
from navfw.report.run_story import StoryLine
from navfw.report.run_timeline import newest_pose, planar_pose
from navfw.signals import Pose

_MAX_MOMENTS = 240
"""Largest number of moments of a report; those of a longer run are further apart."""

_MAX_TEXT = 8000
"""Largest length of the rules of a moment [characters]; longer text is cut."""
_MAX_POINTS = 2000
"""Largest number of flow vectors, and of cells, of a moment."""
_WIDTH = 320
"""Width to which larger camera images are reduced [px]."""
_QUALITY = 75
"""Quality of the camera images (WebP), of 100."""
SHOWN = (
    topics.FLOW,
    topics.CELLS,
    topics.PERCEPT,
    topics.COMMAND,
    topics.LOCAL_MAP,
    topics.OBSTACLES,
    topics.TRUE_OBSTACLES,
    topics.TRANSFORMS,
    topics.POSE,
    topics.TRUE_POSE,
    topics.PATH,
)
"""The channels that reports and videos show besides the camera's images."""


@dataclass(frozen=True, slots=True)
class Rating:
    """The ratings of all commands by the behaviours ``names``, scaled from [0, 1] to 0 to 255.

    ``desirability``, ``prohibition`` (behaviours, speeds, turns) uint8; ``v`` [m/s] and ``w``
    [rad/s] are each the lowest value and the step.
    """

    names: tuple[str, ...]
    desirability: npt.NDArray[np.uint8]
    prohibition: npt.NDArray[np.uint8]
    v: tuple[float, float]
    w: tuple[float, float]

    def commands(self, reverse: int) -> tuple[Array, Array]:
        """Return the speeds [m/s], the first ``reverse`` of them backward, and the turns [rad/s].

        Backward speeds have a step of their own, from the lowest speed to 0.
        """
        speeds, turns = self.prohibition.shape[1:]
        top = self.v[0] + (speeds - 1) * self.v[1]
        reverse = min(reverse, speeds - 1) if self.v[0] < 0.0 else 0
        backward = np.linspace(self.v[0], 0.0, reverse + 1)[:-1]
        forward = np.linspace(0.0 if reverse else self.v[0], top, speeds - reverse)
        last = self.w[0] + (turns - 1) * self.w[1]
        return np.concatenate([backward, forward]), np.linspace(self.w[0], last, turns)


def read_moments(run: RecordedRun, events: Iterable[StoryLine] = ()) -> list[dict[str, Any]]:
    """Read at most 240 moments of ``run``, evenly spaced in its images, and one per event.

    A moment is an image at which the behaviours' ratings were recorded, so that its command is that
    of these ratings: a mapping of what was known at ``time`` [s], as the page's script reads it.
    ``image`` is a data URL of ``size`` (width, height) [px of the camera]. ``flow`` holds lines
    (x0, y0, x1, y1), ``cells`` groups of points (x, y) with their CSS colour, both in sixteenths of
    a pixel from the upper left corner. In ``map``, ``robot`` is its true pose, ``estimate`` the
    believed one, ``way`` the points x, y [m] of the path ahead; ``movers`` are discs (x, y,
    radius), ``courses`` their paths of the next second, ``walkers`` the true discs. ``map`` is the
    local map with its lowest corner, yaw and size; ``rating`` a ``Rating``; ``inputs`` the values
    that the leader's rules name; ``chase`` the view from behind as a data URL; None where one is
    not known.

    Raises:
        ConfigError: the recording is damaged.

    """
    stamps: dict[str, list[int]] = {topics.CAMERA_IMAGE: [], topics.PROPOSALS: []}
    for topic, stamp, _ in run.packed(*stamps):
        stamps[topic].append(stamp)
    images, rated = (np.array(times, dtype=np.int64) for times in stamps.values())
    shown = np.flatnonzero(np.isin(images, rated) | (images < min(rated, default=math.inf)))
    if not len(shown):
        return []
    kept = shown[np.linspace(0, len(shown) - 1, min(len(shown), _MAX_MOMENTS)).round().astype(int)]
    at = np.array([topics.nanoseconds(event.time) for event in events], dtype=np.int64)
    of_events = shown[np.minimum(np.searchsorted(images[shown], at), len(shown) - 1)]
    wanted = (*SHOWN, topics.RULES, topics.PROPOSALS)
    moments: list[dict[str, Any]] = []
    maps: dict[float, str] = {}
    for newest in newest_at_images(run, wanted, {*kept.tolist(), *of_events.tolist()}):
        with located_damage(run.path, f"a message before {newest[topics.CAMERA_IMAGE].time:.2f} s"):
            moments.append(_moment(newest, run, maps))
    return moments


def newest_at_images(
    run: RecordedRun, wanted: tuple[str, ...], kept: Container[int]
) -> Iterator[dict[str, RecordedMessage]]:
    """For each image whose number is in ``kept``: the newest message of each ``wanted`` topic.

    Each mapping also has the image. Images are later in the file than messages of the same time, as
    they are compressed meanwhile.
    """
    newest: dict[str, RecordedMessage] = {}
    others = run.messages(*wanted)
    ahead = next(others, None)
    for number, image in enumerate(run.messages(topics.CAMERA_IMAGE)):
        while ahead is not None and ahead.time <= image.time + 1e-9:
            newest[ahead.topic] = ahead
            ahead = next(others, None)
        if number in kept:
            yield newest | {topics.CAMERA_IMAGE: image}


def chase_picture(run: RecordedRun, content: Mapping[str, Any]) -> Image | None:
    """Draw the view of ``run`` from behind the true pose; None if world or pose is unknown."""
    pose = newest_pose(content, topics.TRUE_POSE)
    return None if run.chase is None or pose is None else run.chase(pose, _walkers(content))


def _walkers(content: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    entities = content.get(topics.TRUE_OBSTACLES, _NOTHING).entities
    bodies = [body for entity in entities for body in entity.cylinders]
    return [(b.pose.position.x, b.pose.position.y, 0.5 * b.size.x) for b in bodies]


_NOTHING = SimpleNamespace(points=(), entities=(), poses=())
"""A message without content."""


def _moment(
    newest: dict[str, RecordedMessage], run: RecordedRun, maps: dict[float, str]
) -> dict[str, Any]:
    """The moment of the ``newest`` messages; ``maps`` are pictures of local maps by their time."""
    picture = newest[topics.CAMERA_IMAGE]
    image = image_of(picture, run.path)
    content = {topic: message.content for topic, message in newest.items()}
    said = [newest[topic] for topic in (topics.PERCEPT, topics.RULES) if topic in newest]
    # percepts are recorded more seldom than they decide
    latest = max(said, key=lambda message: message.time).content if said else {}
    rules = content.get(topics.RULES)
    groups = content.get(topics.CELLS, _NOTHING).points
    behind = chase_picture(run, content)
    flow = [_points(group, 2 * _MAX_POINTS) for group in content.get(topics.FLOW, _NOTHING).points]
    robot, estimate = (newest_pose(content, name) for name in (topics.TRUE_POSE, topics.POSE))
    return {
        "time": picture.time,
        "image": reduced_source(image, _WIDTH, quality=_QUALITY),
        "size": image.shape[::-1],
        "flow": flow[0] if flow else [],
        "cells": [(_css(group.outline_color), _points(group, _MAX_POINTS)) for group in groups],
        "sentence": str(latest.get("perception", latest).get("sentence", "")),
        "rules": "\n".join(explanation_lines(rules))[:_MAX_TEXT] if rules else "",
        "command": dict(content.get(topics.COMMAND, {})),
        "inputs": _leading_inputs(rules or {}),
        "robot": None if robot is None else asdict(robot),
        "estimate": None if estimate is None else asdict(estimate),
        "way": [(p.position.x, p.position.y) for p in content.get(topics.PATH, _NOTHING).poses],
        "walkers": _walkers(content),
        "chase": None if behind is None else reduced_source(behind, _WIDTH, quality=60),
        **_surroundings(newest, maps),
        "rating": _rating(content[topics.PROPOSALS]) if topics.PROPOSALS in content else None,
    }


def _leading_inputs(explanation: Mapping[str, Any]) -> dict[str, float]:
    """Return the values of the inputs that the fired rules of the leading behaviour name."""
    leader = explanation.get("behaviors", {}).get(explanation.get("leader"), {})
    named = [rule.get("inputs", {}).items() for rule in leader.get("rules", ())]
    return {name: value for items in named for name, value in items if value is not None}


def _surroundings(newest: Mapping[str, RecordedMessage], maps: dict[float, str]) -> dict[str, Any]:
    """What is known of the surroundings, where ``odom`` is known in ``map``."""
    shown: dict[str, Any] = {"movers": [], "courses": [], "map": None}
    if topics.TRANSFORMS not in newest:
        return shown
    odom = planar_pose(newest[topics.TRANSFORMS].content.transforms[0].transform)
    if topics.OBSTACLES in newest:
        for ends, (x, y), radius in moving_obstacles(newest[topics.OBSTACLES].content, odom):
            shown["movers"].append((x, y, radius))
            shown["courses"].append(ends.tolist())
    if topics.LOCAL_MAP in newest:
        time, grid = newest[topics.LOCAL_MAP].time, newest[topics.LOCAL_MAP].content
        picture = local_map_picture(grid)
        if time not in maps:
            maps[time] = reduced_source(picture[::-1], picture.shape[1], lossless=True)
        at = odom.to_parent(grid.pose.position.x, grid.pose.position.y)
        rows, columns = picture.shape[:2]
        size = grid.cell_size.x * columns, grid.cell_size.y * rows
        shown["map"] = (maps[time], asdict(Pose(*at, odom.yaw)), size)
    return shown


def moving_obstacles(scene: Any, odom: Pose) -> Iterator[tuple[Array, tuple[float, float], float]]:
    """Yield course, centre and radius [m] of the obstacles in an ``obstacles_message``.

    A course (2, 2) leads to the position a second later; all are in the parent frame of ``odom``.
    """
    for entity in scene.entities:
        for body, line in zip(entity.cylinders, entity.lines, strict=True):
            ends = odom.points_to_parent(np.array([(p.x, p.y) for p in line.points]))
            at = odom.to_parent(body.pose.position.x, body.pose.position.y)
            yield ends, at, 0.5 * body.size.x


_KNOWN = 0.04
"""Smallest difference of the occupancy from one half at which a cell of the local map is shown."""
_STRENGTH = 1.3
"""Opacity of the local map per difference of the occupancy from one half."""


def local_map_picture(grid: Any) -> Image:
    """Draw ``viewer_messages.local_map_message``: a picture (rows, columns, 4), BGR and opacity."""
    percent = np.frombuffer(grid.data, dtype=np.uint8).reshape(-1, grid.column_count)
    lean = percent / 100.0 - 0.5
    picture = np.zeros((*percent.shape, 4), dtype=np.uint8)
    for side, color in ((lean, palette.OCCUPIED), (-lean, palette.FREE)):
        picture[side > _KNOWN, :3] = palette.bgr(color)
    opacity = np.where(abs(lean) > _KNOWN, np.minimum(_STRENGTH * abs(lean), 1.0), 0.0)
    picture[..., 3] = np.rint(255.0 * opacity)
    return picture


def _points(group: Any, limit: int) -> list[int]:
    """Return the points of an annotation one after the other, in sixteenths of a pixel."""
    return [round(16.0 * value) for p in group.points[:limit] for value in (p.x, p.y)]


def _css(color: Any) -> str:
    parts = ", ".join(str(round(255.0 * share)) for share in (color.r, color.g, color.b))
    return f"rgba({parts}, {color.a:.2f})"


def _rating(grid: Any) -> Rating:
    """Return the ratings in a grid of ``viewer_messages.proposals_message``."""
    names = tuple(f.name.removesuffix(".desirability") for f in list(grid.fields)[::2])
    speeds, fields = int(grid.column_count), len(grid.fields)
    cells = np.frombuffer(grid.data, dtype=np.uint8).reshape(-1, speeds, fields)
    by_field = cells.transpose(2, 1, 0)
    first, step = grid.pose.position, grid.cell_size
    return Rating(names, by_field[::2], by_field[1::2], (first.x, step.x), (first.y, step.y))
