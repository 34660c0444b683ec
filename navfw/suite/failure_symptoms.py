"""Symptoms of a failed run, for ``navfw.suite.failure_causes``.

After the run, and for evaluation only, the stack's local map is compared with the true geometry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from navfw.errors import WorldError
from navfw.localmap import LocalMap
from navfw.localmap.local_planner import LocalPlanner
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.missions.run_metrics import path_length
from navfw.missions.session import MissionResult
from navfw.numerics import Array, Mask
from navfw.recording.run_observers import Contact, RunLog
from navfw.signals import Odometry, Pose, Sight, wrap_angle
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle
from navfw.sim.solids import Solid
from navfw.suite.failure_causes import (
    CollisionSymptoms,
    FailureSymptoms,
    MotionSymptoms,
    PathSymptoms,
)

_RECENT = 30.0
"""Duration [s] of the end of a run over which its recent motion and sight are measured."""

APPROACH = 0.25
"""Time [s] before a contact over which the robot's speed is averaged."""

_PHANTOM, _BLUR = 0.25, 0.1
"""Distances [m] to the nearest object beyond which an occupied cell is a phantom, or a blur."""

REACH = 0.12
"""Radius [m] about a point of contact within which the local map is evaluated."""


def collect_symptoms(result: MissionResult) -> FailureSymptoms:
    """The symptoms of ``result``. Clears wrong cells of the stack's local map as a side effect."""
    session, log, metrics = result.session, result.log, result.metrics
    spec = session.mission.spec
    stack = session.stack
    odometry = stack.state.odometry
    decided = int(np.searchsorted(log.time, stack.state.time - 1e-9))
    now = Pose(*log.true[decided]) if decided < log.ticks else None  # the log may end before it
    collision = path = None
    if log.contacts and now is not None:
        collision = _collision(result, now)
    elif odometry is not None and now is not None:
        path = _path(result, odometry, now)
    return FailureSymptoms(
        outcome=result.outcome,
        estimate_error=metrics.estimate_error_m,
        estimate_error_max=metrics.estimate_error_max_m,
        slack=max(0.0, spec.success.within - spec.tolerance),
        collision=collision,
        path=path,
        motion=_motion(result) if log.ticks else None,
        sight=Sight(int(np.median(log.sight[_late(log)]))) if log.ticks else Sight.ENOUGH,
        fault=result.verdict.fault,
    )


# --- collisions ----------------------------------------------------------------------------------


def _collision(result: MissionResult, now: Pose) -> CollisionSymptoms:
    session, log = result.session, result.log
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
        mapped=_mapped(session.stack.local_map, session.stack.state.odometry, now, point),
    )


def _touched_point(result: MissionResult, contact: Contact) -> Array:
    """The point [m, map frame] of the touched object that is nearest to the robot's centre.

    The robot's centre itself if the object's outline is not known.
    """
    movers, plan, changes = result.movers, result.session.plan, result.changes
    if movers is not None and contact.body in movers.names:
        index = movers.names.index(contact.body)
        x, y = movers.at(np.array([contact.time]))[0, index]
        shapes = [Solid(contact.body, "mover", Circle(x, y, float(movers.radii[index])))]
    else:
        shapes = [solid for solid in plan.solids if solid.name == contact.body]
        shapes += [
            Solid(contact.body, "box", presence.shape)
            for presence in (changes.presences if changes is not None else ())
            if presence.name == contact.body
        ]
    if not shapes:
        return np.array([contact.x, contact.y])
    return _nearest_point(SceneGeometry(plan.bounds, tuple(shapes)), contact.x, contact.y)


def _nearest_point(plan: SceneGeometry, x: float, y: float) -> Array:
    """The point of the plan's solids that is nearest to (x, y), along the distance's gradient."""
    step = 1e-4
    around = np.array([[x, y], [x + step, y], [x - step, y], [x, y + step], [x, y - step]])
    distance = plan.clearances(around)
    gradient = np.array([distance[1] - distance[2], distance[3] - distance[4]]) / (2.0 * step)
    nearest: Array = np.array([x, y]) - distance[0] * gradient
    return nearest


def _mapped(
    local_map: LocalMap, odometry: Odometry | None, now: Pose, point: Array
) -> Literal["occupied", "free", "unknown", ""]:
    """State of the local map about a true ``point`` (map frame), outside the robot's own body."""
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
    """(n, n) odom x and y [m] of the centres of the local map's cells."""
    index = np.arange(occupancy.size) * occupancy.params.cell
    x, y = np.meshgrid(occupancy.origin[0] + index, occupancy.origin[1] + index)
    return x, y


# --- the local path -------------------------------------------------------------------------------


def _path(result: MissionResult, odometry: Odometry, now: Pose) -> PathSymptoms | None:
    """Costs of the local path with the local map as it is, and with wrong cells cleared."""
    stack = result.session.stack
    local_map, context = stack.local_map, stack.mofis.context
    if context is None or context.waypoint is None or context.local_goal is None:
        return None
    occupancy, pose = local_map.occupancy, odometry.pose
    x, y = pose.to_parent(*context.waypoint_local)
    off = _distance_from_truth(result, occupancy, pose, now)
    costs = []
    for limit in (math.inf, _PHANTOM, _BLUR):
        occupancy.log_odds[off > limit] = 0.0
        occupancy.update(pose, odometry.time)  # drops what was derived from the log-odds
        goal = LocalPlanner(local_map.params.local_planner).plan(occupancy, pose, x, y)
        costs.append(goal.cost if goal.reachable else math.inf)
    return PathSymptoms(*costs)


def _distance_from_truth(
    result: MissionResult, occupancy: OccupancyGrid, pose: Pose, now: Pose
) -> Array:
    """(n, n) true distance [m] of occupied cells to the nearest object; 0 for all other cells.

    ``pose`` is the robot's in odom, ``now`` its true one.
    """
    plan, movers = result.session.plan, result.movers
    distance: Array = np.zeros((occupancy.size, occupancy.size))
    occupied = occupancy.occupied
    x, y = (axis[occupied] for axis in _cells(occupancy))
    if not x.size:
        return distance
    true = now.points_to_parent(pose.points_to_local(np.column_stack([x, y])))
    away = plan.clearances(true)
    if movers is not None:
        ended = np.full(len(true), result.session.stack.state.time)
        away = np.minimum(away, movers.clearances(true, ended))
    distance[occupied] = away
    return distance


# --- motion and sight --------------------------------------------------------------------------


def _motion(result: MissionResult) -> MotionSymptoms:
    session, log = result.session, result.log
    sampled = log.every(0.1)
    true, time = log.true[sampled], log.time[sampled]
    late = time >= time[-1] - _RECENT
    recent = true[late]
    turned = np.abs([wrap_angle(step) for step in np.diff(recent[:, 2])]).sum()
    goals = [(goal.x, goal.y) for goal in session.mission.goals]
    task = session.task
    remaining = _remaining(session.plan, true, goals, task.success_radius, task.robot.radius)
    return MotionSymptoms(
        driven=path_length(true),
        gained=session.shortest - remaining,
        recent=float(time[-1] - time[late][0]),
        recent_driven=path_length(recent),
        recent_turned=float(turned),
        vetoed=float(log.vetoed[_late(log)].mean()),
    )


def _late(log: RunLog) -> Mask:
    """Which ticks (n,) belong to the end of the run."""
    late: Mask = log.time >= log.time[-1] - _RECENT
    return late


def _remaining(
    plan: SceneGeometry,
    true: Array,
    goals: Sequence[tuple[float, float]],
    within: float,
    radius: float,
) -> float:
    """Length [m] of the shortest path from the end of ``true`` through the goals not yet visited.

    Straight distances where the robot is too close to an object for a path search.
    """
    ahead = list(goals)
    for x, y in true[:, :2]:
        if len(ahead) > 1 and math.dist((x, y), ahead[0]) <= within:
            ahead.pop(0)
    total, point = 0.0, (float(true[-1, 0]), float(true[-1, 1]))
    for goal in ahead:
        try:
            total += plan.shortest_path(point, goal, radius)[0]
        except WorldError:
            total += math.dist(point, goal)
        point = goal
    return total
