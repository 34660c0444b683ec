"""The time series of a recorded run, and the events in it that a reader wants to see."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from navfw.numerics import Array
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun, located_damage
from navfw.recording.run_folder import RESULT
from navfw.recording.top_view import WorldOutline
from navfw.report.run_story import EPISODES, StoryLine
from navfw.signals import Pose

_MAX_ROWS = 4000
"""Largest number of rows; of a longer run only every n-th command is taken."""


@dataclass(frozen=True, slots=True)
class RunTimeline:
    """The time series of a run, one row per command (n rows), and the outline of its world.

    ``true`` and ``estimate`` (n, 2) [m] are positions in ``map``, ``leaders`` (n,) the leading
    behaviours, ``held`` (n,) the reason why the safety monitor held the robot ("": it did not),
    ``commands`` (n, 2) v [m/s] and w [rad/s]. ``clearance`` (n,) [m] is the distance from the
    robot's edge to walls and furniture, nan if none is known; ``confidence`` (n,) that of the
    position in [0, 1], nan without one. ``driven`` (n, 2) are the commands of another driver that
    drove instead of the stack, nan without one. If the true position is not known, ``true`` is the
    estimate.
    """

    time: Array
    true: Array
    estimate: Array
    leaders: tuple[str, ...]
    held: tuple[str, ...]
    commands: Array
    clearance: Array
    confidence: Array
    driven: Array
    outline: WorldOutline


def read_timeline(run: RecordedRun, robot_radius: float) -> RunTimeline:
    """Read the time series of ``run``; clearances are from a disc of ``robot_radius`` [m].

    Raises:
        ConfigError: the recording is damaged.

    """
    with located_damage(run.path, "a message"):
        outline = WorldOutline()
        nowhere = (math.nan, math.nan)
        true, estimate, driven = nowhere, nowhere, nowhere
        rows: list[tuple[float, ...]] = []
        leaders: list[str] = []
        held: list[str] = []
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
                held.append(str(content.get("held", "")))
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
            held=tuple(held[::step]),
            commands=table[:, 5:7],
            clearance=clearance,
            confidence=table[:, 7],
            driven=table[:, 8:],
            outline=outline,
        )


def robot_and_goals(result: Mapping[str, Any]) -> tuple[float, list[tuple[float, float]]]:
    """Return the robot's radius [m] and the goals (x, y) [m, ``map``] of a result."""
    with located_damage(Path(RESULT), "its configuration, which has the robot's radius and goals,"):
        mission = result["config"]["mission"]
        goals = [(float(goal["x"]), float(goal["y"])) for goal in mission["goals"]]
        return float(mission["robot"]["radius"]), goals


MAX_EVENTS = 80
"""Largest number of events of a report."""
_KINDS = ("contact", "clearance", "event", *EPISODES)
"""Kinds of events; a report opens at an event of the first of these that occurred."""


def event_rank(event: StoryLine) -> tuple[int, float]:
    """A sort key of events: the most important kinds first, then by time."""
    return _KINDS.index(event.kind), event.time


def run_events(timeline: RunTimeline, story: Sequence[StoryLine]) -> list[StoryLine]:
    """Select contacts, mission events and episodes of a ``story``; add the smallest clearance."""
    events = [line for line in story if line.kind in _KINDS]
    if not np.isnan(timeline.clearance).all():
        least = int(np.nanargmin(timeline.clearance))
        time, text = float(timeline.time[least]), f"{timeline.clearance[least]:.2f} m"
        events.append(StoryLine(time, time, "clearance", f"least clearance, {text}"))
    events = sorted(events, key=event_rank)[:MAX_EVENTS]
    return sorted(events, key=lambda event: event.time)


def _outline(scene: Any) -> WorldOutline:
    """Return the world in a message of ``/world`` from above."""
    entity = scene.entities[0]
    boxes = [(cube.size.z, _corners(cube)) for cube in entity.cubes]
    tall = max((height for height, _ in boxes), default=0.0)
    places = [(c.pose.position, c.size) for c in entity.cylinders]
    return WorldOutline(
        walls=[corners for height, corners in boxes if height == tall],
        furniture=[corners for height, corners in boxes if height != tall],
        discs=[(at.x, at.y, 0.5 * size.x) for at, size in places],
    )


def _corners(cube: Any) -> Array:
    """Return the corners (4, 2) [m] of a cube that is turned about its vertical axis."""
    half = 0.5 * np.array([cube.size.x, cube.size.y])
    around = half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return planar_pose(cube).points_to_parent(around)


def planar_pose(message: Any) -> Pose:
    """Convert a transform, or the pose of a message, with covariance or not, to a planar pose."""
    if hasattr(message, "translation"):
        place, turn = message.translation, message.rotation
    else:
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        place, turn = pose.position, pose.orientation
    return Pose(place.x, place.y, 2.0 * math.atan2(turn.z, turn.w))


def newest_pose(content: Mapping[str, Any], topic: str) -> Pose | None:
    """Return the planar pose of the newest message on channel ``topic``; None without one."""
    return planar_pose(content[topic]) if topic in content else None


def _clearance(points: Array, outline: WorldOutline) -> Array:
    """The distance [m] of each of ``points`` (n, 2) to the nearest object; nan without any."""
    contours = [
        np.asarray(corners, dtype=np.float32) for corners in (*outline.walls, *outline.furniture)
    ]
    nearest = np.full(len(points), math.inf)
    for row, (x, y) in enumerate(points.tolist()):
        away = [-cv2.pointPolygonTest(contour, (x, y), True) for contour in contours]
        away += [math.hypot(x - at_x, y - at_y) - radius for at_x, at_y, radius in outline.discs]
        nearest[row] = min(away, default=math.inf)
    nearest[~np.isfinite(nearest)] = math.nan
    return nearest
