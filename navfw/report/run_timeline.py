"""The course of a recorded run: positions, leader, speed, clearance and confidence over time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from navfw.errors import ConfigError
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun
from navfw.recording.run_folder import RESULT
from navfw.recording.top_view import OutlineDisc, WorldOutline
from navfw.signals import Array

_MAX_ROWS = 4000
"""Largest number of rows; of a longer run every n-th command is taken."""


@dataclass(frozen=True, slots=True)
class RunTimeline:
    """The course of a run, one row per command (n rows), and the world that it went through.

    ``true`` and ``estimate`` (n, 2) [m] are positions in ``map``, ``leaders`` (n,) the leading
    behaviours, ``commands`` (n, 2) v [m/s] and w [rad/s]. ``clearance`` (n,) [m] is the distance of
    the robot's edge to walls and furniture, nan where none is known; ``confidence`` (n,) that of
    the position in [0, 1], nan where there is none.
    """

    time: Array
    true: Array
    estimate: Array
    leaders: tuple[str, ...]
    commands: Array
    clearance: Array
    confidence: Array
    outline: WorldOutline


def read_timeline(run: RecordedRun, robot_radius: float) -> RunTimeline:
    """The course of ``run``; ``robot_radius`` [m] is subtracted from distances.

    Raises:
        ConfigError: the recording is damaged.

    """
    try:
        return _read(run, robot_radius)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        what = f"a message is damaged ({type(error).__name__}: {error})"
        raise ConfigError(what, file=run.path) from None


def robot_and_goals(result: Mapping[str, Any]) -> tuple[float, list[tuple[float, float]]]:
    """The robot's radius [m] and the goals (x, y) [m] in a result."""
    try:
        mission = result["config"]["mission"]
        goals = [(float(goal["x"]), float(goal["y"])) for goal in mission["goals"]]
        return float(mission["robot"]["radius"]), goals
    except (KeyError, TypeError, ValueError) as error:
        what = f"its configuration has no robot's radius or goals ({type(error).__name__}: {error})"
        raise ConfigError(what, file=RESULT) from None


def _read(run: RecordedRun, robot_radius: float) -> RunTimeline:
    outline = WorldOutline()
    nowhere = (math.nan, math.nan)
    true, estimate = nowhere, nowhere
    rows: list[tuple[float, ...]] = []
    leaders: list[str] = []
    wanted = (topics.WORLD, topics.TRUE_POSE, topics.POSE, topics.COMMAND)
    for message in run.messages(*wanted):
        content = message.content
        if message.topic == topics.WORLD:
            outline = _outline(content) if not outline.walls else outline
        elif message.topic == topics.TRUE_POSE:
            true = (content.pose.position.x, content.pose.position.y)
        elif message.topic == topics.POSE:
            estimate = (content.pose.position.x, content.pose.position.y)
        else:
            confidence = math.nan if content["confidence"] is None else float(content["confidence"])
            drive = (float(content["v"]), float(content["w"]))
            rows.append((message.time, *true, *estimate, *drive, confidence))
            leaders.append(str(content["leader"]))
    step = max(1, math.ceil(len(rows) / _MAX_ROWS))
    table = np.array(rows[::step], dtype=np.float64).reshape(-1, 8)
    clearance = _clearance(table[:, 1:3], outline) - robot_radius
    return RunTimeline(
        time=table[:, 0],
        true=table[:, 1:3],
        estimate=table[:, 3:5],
        leaders=tuple(leaders[::step]),
        commands=table[:, 5:7],
        clearance=clearance,
        confidence=table[:, 7],
        outline=outline,
    )


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
    yaw = 2.0 * math.atan2(cube.pose.orientation.z, cube.pose.orientation.w)
    c, s = 0.5 * math.cos(yaw), 0.5 * math.sin(yaw)
    along = np.array([c, s]) * cube.size.x
    across = np.array([-s, c]) * cube.size.y
    middle = np.array([cube.pose.position.x, cube.pose.position.y])
    return np.stack(
        [
            middle - along - across,
            middle + along - across,
            middle + along + across,
            middle - along + across,
        ]
    )


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
