"""What a failed run's record shows: numbers for ``navfw.suite.failure_causes``.

After the run, and for evaluation only, the true geometry is laid beside what the stack remembered
in its ego map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from navfw.errors import WorldError
from navfw.localmap import LocalMap
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.missions.run_metrics import path_length
from navfw.missions.session import MissionResult
from navfw.recording.run_log import Contact, RunLog
from navfw.signals import Array, Odometry, Pose, wrap_angle
from navfw.sim.floorplan import FloorPlan, NamedShape
from navfw.sim.shapes import Circle
from navfw.suite.failure_causes import (
    CollisionSymptoms,
    FailureSymptoms,
    MotionSymptoms,
    PathSymptoms,
)

__all__ = ["collect_symptoms"]

RECENT = 30.0
"""What "recently" means [s]."""

APPROACH = 0.25
"""Speeds at a contact are means over this long before it [s]."""

GHOST, BLUR = 0.25, 0.1
"""What is remembered this far [m] from anything there is, is a ghost, or blurs an outline."""

REACH = 0.12
"""How far [m] about a point of contact the memory is asked."""


def collect_symptoms(result: MissionResult) -> FailureSymptoms:
    """The evidence of how ``result`` came about. It corrects the stack's memory on the way."""
    session, log, metrics = result.session, result.run.log, result.metrics
    spec = session.mission.spec
    stack = session.stack
    odometry = stack.state.odometry
    now = _true_at(log, stack.state.time)
    touch = aiming = None
    if log.contacts and now is not None:
        touch = _touch(result, now)
    elif odometry is not None and now is not None:
        aiming = _aiming(result, odometry, now)
    return FailureSymptoms(
        outcome=result.outcome,
        estimate_error=metrics.estimate_error_m,
        estimate_error_max=metrics.estimate_error_max_m,
        slack=max(0.0, spec.success.within - spec.tolerance),
        touch=touch,
        aiming=aiming,
        driving=_driving(result) if log.ticks else None,
        exception=bool(result.run.verdict.trace),
        sensor_failed=session.stack.state.fault is not None,
    )


def _true_at(log: RunLog, time: float) -> Pose | None:
    """The true pose at the stack's last decision."""
    index = int(np.searchsorted(log.time, time - 1e-9))
    return Pose(*log.true[index]) if index < log.ticks else None


# --- collisions ----------------------------------------------------------------------------------


def _touch(result: MissionResult, now: Pose) -> CollisionSymptoms:
    session, log = result.session, result.run.log
    contact = log.contacts[0]
    since = min(int(np.searchsorted(log.time, contact.time - APPROACH)), log.ticks - 1)
    yaw = float(log.true[-1, 2])
    moved = np.array([contact.x, contact.y]) - log.true[since, :2]
    elapsed = max(contact.time - float(log.time[since]), 1e-3)
    point = _touched_point(result, contact)
    toward = point - (contact.x, contact.y)
    return CollisionSymptoms(
        by_mover=result.collision_cause == "mover",
        bearing=wrap_angle(math.atan2(toward[1], toward[0]) - yaw),
        speed=float(moved @ (math.cos(yaw), math.sin(yaw))) / elapsed,
        memory=_remembered(session.stack.local_map, session.stack.state.odometry, now, point),
    )


def _touched_point(result: MissionResult, contact: Contact) -> Array:
    """The point [m, map] of what was touched that is nearest to the robot's centre.

    The robot's centre itself if nobody knows where the thing is.
    """
    movers, plan, changes = result.movers, result.session.plan, result.changes
    if movers is not None and contact.body in movers.names:
        index = movers.names.index(contact.body)
        x, y = movers.at(np.array([contact.time]))[0, index]
        shapes = [NamedShape(contact.body, "mover", Circle(x, y, float(movers.radii[index])))]
    else:
        shapes = [solid for solid in plan.solids if solid.name == contact.body]
        shapes += [
            NamedShape(contact.body, "box", presence.shape)
            for presence in (changes.presences if changes is not None else ())
            if presence.name == contact.body
        ]
    if not shapes:
        return np.array([contact.x, contact.y])
    return _nearest_point(FloorPlan(plan.bounds, tuple(shapes)), contact.x, contact.y)


def _nearest_point(plan: FloorPlan, x: float, y: float) -> Array:
    """The point of the plan's solids that is nearest to (x, y), along the distance's gradient."""
    step = 1e-4
    around = np.array([[x, y], [x + step, y], [x - step, y], [x, y + step], [x, y - step]])
    distance = plan.clearances(around)
    gradient = np.array([distance[1] - distance[2], distance[3] - distance[4]]) / (2.0 * step)
    nearest: Array = np.array([x, y]) - distance[0] * gradient
    return nearest


def _remembered(
    local_map: LocalMap, odometry: Odometry | None, now: Pose, point: Array
) -> Literal["occupied", "free", "unknown", ""]:
    """What the ego map says about a true ``point`` (map frame), the body's own place left out."""
    if odometry is None:
        return ""
    occupancy, pose = local_map.occupancy, odometry.pose
    x, y = pose.to_parent(*now.to_local(*point))
    columns, rows = _cells(occupancy)
    away = np.hypot(columns - x, rows - y)
    outside = np.hypot(columns - pose.x, rows - pose.y) > occupancy.robot.radius
    near = (away <= REACH) & outside
    if not near.any():
        return "unknown"
    if occupancy.occupied[near].any():
        return "occupied"
    return "free" if occupancy.observed[near].mean() > 0.5 else "unknown"


def _cells(occupancy: OccupancyGrid) -> tuple[Array, Array]:
    """(n, n) odom x and y [m] of the middles of the ego map's cells."""
    index = np.arange(occupancy.size) * occupancy.params.cell
    x, y = np.meshgrid(occupancy.origin[0] + index, occupancy.origin[1] + index)
    return x, y


# --- the way ahead -------------------------------------------------------------------------------


def _aiming(result: MissionResult, odometry: Odometry, now: Pose) -> PathSymptoms | None:
    """The remembered way as it is, and with what is wrong in the memory forgotten."""
    stack = result.session.stack
    local_map, context = stack.local_map, stack.mofis.context
    if context is None or context.waypoint is None or context.local_goal is None:
        return None
    occupancy, pose = local_map.occupancy, odometry.pose
    x, y = pose.to_parent(*context.waypoint_local)
    off = _distance_from_truth(result, occupancy, pose, now)
    costs = []
    for limit in (math.inf, GHOST, BLUR):
        occupancy.log_odds[off > limit] = 0.0
        occupancy.update(pose, odometry.time)  # drops what was derived from the log-odds
        goal = local_map.local_planner.plan(occupancy, pose, x, y)
        costs.append(goal.cost if goal.reachable else math.inf)
    return PathSymptoms(*costs)


def _distance_from_truth(
    result: MissionResult, occupancy: OccupancyGrid, pose: Pose, now: Pose
) -> Array:
    """(n, n) distance [m] of what is remembered to the nearest thing in truth; 0 where nothing is.

    ``pose`` and ``now`` are the robot's, in odom and in truth.
    """
    plan, movers = result.session.plan, result.movers
    distance: Array = np.zeros((occupancy.size, occupancy.size))
    occupied = occupancy.occupied
    x, y = (axis[occupied] for axis in _cells(occupancy))
    if not x.size:
        return distance
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    ahead = c * (x - pose.x) + s * (y - pose.y)
    left = -s * (x - pose.x) + c * (y - pose.y)
    c, s = math.cos(now.yaw), math.sin(now.yaw)
    true = np.column_stack([now.x + c * ahead - s * left, now.y + s * ahead + c * left])
    away = plan.clearances(true)
    if movers is not None:
        ended = np.full(len(true), result.session.stack.state.time)
        away = np.minimum(away, movers.clearances(true, ended))
    distance[occupied] = away
    return distance


# --- how it drove --------------------------------------------------------------------------------


def _driving(result: MissionResult) -> MotionSymptoms:
    session, log = result.session, result.run.log
    sampled = log.every(0.1)
    true, time = log.true[sampled], log.time[sampled]
    late = time >= time[-1] - RECENT
    recent = true[late]
    turned = np.abs([wrap_angle(step) for step in np.diff(recent[:, 2])]).sum()
    goals = [(goal.x, goal.y) for goal in session.mission.goals]
    left = _left(session.plan, true, goals, session.task.success_radius, session.task.robot.radius)
    return MotionSymptoms(
        driven=path_length(true),
        gained=session.shortest - left,
        recent=float(time[-1] - time[late][0]),
        recent_driven=path_length(recent),
        recent_turned=float(turned),
    )


def _left(
    plan: FloorPlan,
    true: Array,
    goals: Sequence[tuple[float, float]],
    within: float,
    radius: float,
) -> float:
    """The length [m] of the shortest way from the end of ``true`` past the goals not yet visited.

    Straight where the robot stands too near to something for a way to be searched.
    """
    ahead = list(goals)
    for x, y in true[:, :2]:
        if len(ahead) > 1 and math.dist((x, y), ahead[0]) <= within:
            ahead.pop(0)
    total, here = 0.0, (float(true[-1, 0]), float(true[-1, 1]))
    for goal in ahead:
        try:
            total += plan.shortest_path(here, goal, radius)[0]
        except WorldError:
            total += math.dist(here, goal)
        here = goal
    return total
