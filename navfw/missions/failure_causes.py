"""Causes of failed runs, classified from their symptoms.

The symptoms are computed after the run, for evaluation only, from its log, the true geometry and
the stack's own local map. If they show nothing, the cause is ``unknown``.
"""

from __future__ import annotations

import copy
import math
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from navfw.errors import WorldError
from navfw.localmap import LocalMap
from navfw.localmap.local_planner import LocalPlanner
from navfw.localmap.occupancy_grid import OccupancyGrid
from navfw.missions.missed_walkers import how_missed
from navfw.missions.outcome import Cause, Outcome
from navfw.missions.run_metrics import path_length
from navfw.numerics import Array, Mask
from navfw.recording.run_observers import Contact, RunLog
from navfw.signals import Odometry, Pose, Sight, wrap_angle
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle
from navfw.sim.solids import Solid

MissionResult = Any
"""Stands for ``navfw.missions.session.MissionResult``, whose module imports this one."""

_REVERSING = 0.05
"""Backward speed [m/s] above which a robot counts as reversing at a collision."""

_MEAN_SPEED, _MEAN_RATE = 0.02, 0.1
"""Mean speed [m/s] and turning rate [rad/s] below which a robot counts as standing still."""

_DETOUR = 1.5
"""Ratio of path costs, with and without errors of the local map, that blames these errors."""

Mapped = Literal["occupied", "free", "unknown", ""]
"""The state of a place in the local map; "" if there is no map."""


@dataclass(frozen=True, slots=True)
class FailureSymptoms:
    """Symptoms of a failed run; those of a collision, path or motion only if there was one.

    Estimate errors are in metres; ``slack`` [m] is the largest position error with which the
    mission can still succeed. ``sight`` of the path ahead is the median over the end of the run.

    For a collision, ``by_mover``: a mover ran into a robot that was not driving towards it;
    ``bearing`` [rad, left positive] is from the robot's heading to the object's nearest point,
    whose state in the local map is ``mapped``; ``speed`` [m/s] is the robot's, negative backwards.

    ``path_costs`` are those of the local path to the waypoint at the end, infinite without a path:
    with the map as it is, after clearing occupied cells far from any object, and after also
    clearing those beside the outlines of objects.

    The robot has ``driven`` [m] and the shortest path to the last goal decreased by ``gained`` [m].
    ``recent_driven`` [m] and ``recent_turned`` [rad] are over the last ``recent`` [s], ``vetoed``
    is the share of that time in which the safety monitor stopped the robot.
    """

    outcome: Outcome
    fault: Cause | None = None
    estimate_error: float = 0.0
    estimate_error_max: float = 0.0
    slack: float = 0.1
    sight: Sight = Sight.ENOUGH
    by_mover: bool = False
    bearing: float = 0.0
    speed: float = 0.0
    mapped: Mapped | None = None
    path_costs: tuple[float, float, float] | None = None
    driven: float = 0.0
    gained: float = 0.0
    recent: float = 0.0
    recent_driven: float = 0.0
    recent_turned: float = 0.0
    vetoed: float = 0.0


def failure_of(result: MissionResult) -> dict[str, Any]:
    """Fields of the result of a failed run: ``cause`` and ``cause_seen``; empty after a success."""
    if result.outcome.succeeded or result.outcome is Outcome.CANCELLED:
        return {}
    try:
        cause = classify(collect_symptoms(result))
        return {} if cause is None else {"cause": cause, "cause_seen": sentence(cause, result)}
    except Exception:  # a failed classification does not invalidate the result
        traceback.print_exc(file=sys.stderr)
        return {"cause": Cause.UNKNOWN}


def classify(symptoms: FailureSymptoms) -> Cause | None:
    """Classify the cause of a failure; None for a run that succeeded or that the user stopped."""
    match symptoms.outcome:
        case Outcome.COLLIDED:
            return _of_collision(symptoms)
        case Outcome.LOST:
            off = symptoms.estimate_error_max >= 0.9 * symptoms.slack
            return Cause.ESTIMATE_ERROR if off else Cause.GOAL_MISSED
        case Outcome.STUCK | Outcome.TIMEOUT:
            return _of_delay(symptoms)
        case Outcome.UNSURE:
            return Cause.ESTIMATE_UNCERTAIN
        case Outcome.FAULT:
            return Cause.UNKNOWN if symptoms.fault is None else symptoms.fault
        case _:
            return None


def _of_collision(symptoms: FailureSymptoms) -> Cause:
    if symptoms.mapped is None:
        return Cause.UNKNOWN
    if symptoms.by_mover:
        return Cause.MOVER
    aside = abs(symptoms.bearing)
    if symptoms.speed < -_REVERSING and aside > 0.5 * math.pi:
        return Cause.REVERSED_INTO
    if symptoms.mapped == "occupied" and aside > 0.25 * math.pi:
        return Cause.TURNED_INTO
    return _BY_MAP[symptoms.mapped]


_BY_MAP = {
    "occupied": Cause.DROVE_INTO,
    "free": Cause.MAPPED_AS_FREE,
    "unknown": Cause.UNSEEN,
    "": Cause.OBSTACLE,
}


def _of_delay(symptoms: FailureSymptoms) -> Cause:
    """The cause of outcome stuck or timeout: from estimate and map first, then from the motion.

    A robot that sees nothing may not go on whatever its map has; one that sees little still can.
    """
    if symptoms.estimate_error > max(0.5, symptoms.slack):
        return Cause.ESTIMATE_ERROR
    if symptoms.sight is Sight.NOTHING:
        return Cause.NOTHING_SEEN
    cost, without_phantoms, sharpened = symptoms.path_costs or (0.0,) * 3
    if cost > _DETOUR * without_phantoms:
        return Cause.PHANTOM_OBSTACLES
    if cost > _DETOUR * sharpened:
        return Cause.BLURRED_MAP
    return Cause.LOCAL_GOAL_UNREACHABLE if math.isinf(cost) else _of_motion(symptoms)


def _of_motion(symptoms: FailureSymptoms) -> Cause:
    if not symptoms.recent:
        return Cause.UNKNOWN
    moved = symptoms.recent_driven >= _MEAN_SPEED * symptoms.recent
    if symptoms.outcome is Outcome.TIMEOUT and moved and symptoms.gained > 0.5 * symptoms.driven:
        return Cause.SLOW
    if symptoms.vetoed > 0.5:
        return Cause.VETOED
    if symptoms.sight is Sight.LITTLE:
        return Cause.LITTLE_SEEN
    turned = symptoms.recent_turned >= _MEAN_RATE * symptoms.recent
    return Cause.OSCILLATING if moved or turned else Cause.STANDSTILL


_LOW = 0.12
"""Height [m] up to which a thing, or a part of it, is a low foot."""


def sentence(cause: Cause, result: MissionResult) -> str:
    """Describe a failure of this cause in words; empty if the outcome's reason says it all."""
    state = result.session.stack.state
    if cause is Cause.ESTIMATE_ERROR and state.belief is not None and state.belief.lost:
        return "the robot did not find out where it was"
    body = result.contacts[0].body if result.contacts else ""
    if result.movers is not None and body in result.movers.names:
        if cause in (Cause.MAPPED_AS_FREE, Cause.UNSEEN):
            return f"a walker ({body}), {how_missed(result, body)}"
        body = f"a walker ({body})"
    elif any(s.top <= _LOW for s in result.session.plan.solids if s.name == body):
        body = f"a low foot ({body})"
    ahead = state.waypoint
    where = "the goal" if ahead is None or ahead.final else ahead.label
    return cause.sentence.format(body=body, waypoint=where)


# --- symptoms ------------------------------------------------------------------------------------

_RECENT = 30.0
"""Duration [s] of the end of a run over which its recent motion and sight are measured."""

APPROACH = 0.25
"""Time [s] before a contact over which the robot's speed is averaged."""

_PHANTOM, _BLUR = 0.25, 0.1
"""Distances [m] to the nearest object beyond which an occupied cell is a phantom, or a blur."""

REACH = 0.12
"""Radius [m] around a point of contact within which the local map is evaluated."""


def collect_symptoms(result: MissionResult) -> FailureSymptoms:
    """Compute the symptoms of ``result`` from its log, the true plan and the stack's map."""
    session, log = result.session, result.log
    spec = session.mission.spec
    stack = session.stack
    odometry = stack.state.odometry
    decided = int(np.searchsorted(log.time, stack.state.time - 1e-9))
    now = Pose(*log.true[decided]) if decided < log.ticks else None  # the log may end before it
    measured: dict[str, Any] = {}
    if log.ticks:
        measured |= {**_motion(result), "sight": Sight(int(np.median(log.sight[_late(log)])))}
    if log.contacts and now is not None:
        measured |= _collision(result, now)
    elif odometry is not None and now is not None:
        measured["path_costs"] = _path_costs(result, odometry, now)
    return FailureSymptoms(
        outcome=result.outcome,
        estimate_error=result.estimate_error_m,
        estimate_error_max=result.estimate_error_max_m,
        slack=max(0.0, spec.success.within - spec.tolerance),
        fault=result.verdict.fault,
        **measured,
    )


# --- collisions ----------------------------------------------------------------------------------


def _collision(result: MissionResult, now: Pose) -> dict[str, Any]:
    session, log = result.session, result.log
    contact = log.contacts[0]
    since = min(int(np.searchsorted(log.time, contact.time - APPROACH)), log.ticks - 1)
    yaw = float(log.true[-1, 2])
    moved = np.array([contact.x, contact.y]) - log.true[since, :2]
    elapsed = max(contact.time - float(log.time[since]), 1e-3)
    point = _touched_point(result, contact)
    toward = point - (contact.x, contact.y)
    return {
        "by_mover": result.collision_cause == "mover",
        "bearing": wrap_angle(math.atan2(toward[1], toward[0]) - yaw),
        "speed": float(moved[0] * math.cos(yaw) + moved[1] * math.sin(yaw)) / elapsed,
        "mapped": _mapped(session.stack.local_map, session.stack.state.odometry, now, point),
    }


def _touched_point(result: MissionResult, contact: Contact) -> Array:
    """Return the point [m, map frame] of the touched object that is nearest to the robot's centre.

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
    return np.asarray(np.array([x, y]) - distance[0] * gradient)


def _mapped(local_map: LocalMap, odometry: Odometry | None, now: Pose, point: Array) -> Mapped:
    """State of the local map about a true ``point`` (map frame), outside the robot's own body."""
    if odometry is None:
        return ""
    occupancy, pose = copy.deepcopy(local_map.occupancy), odometry.pose
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


def _path_costs(result: MissionResult, odometry: Odometry, now: Pose) -> tuple[float, ...] | None:
    """Costs of the local path with the local map as it is, and with wrong cells cleared."""
    stack = result.session.stack
    local_map, context = stack.local_map, stack.mofis.context
    if context is None or context.waypoint is None or context.local_goal is None:
        return None
    occupancy, pose = copy.deepcopy(local_map.occupancy), odometry.pose
    x, y = pose.to_parent(*context.waypoint_local)
    off = _distance_from_truth(result, occupancy, pose, now)
    costs = []
    for limit in (math.inf, _PHANTOM, _BLUR):
        occupancy.log_odds[off > limit] = 0.0
        occupancy.update(pose, odometry.time)  # drops what was derived from the log-odds
        goal = LocalPlanner(local_map.params.local_planner).plan(occupancy, pose, x, y)
        costs.append(goal.cost if goal.reachable else math.inf)
    return tuple(costs)


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


def _motion(result: MissionResult) -> dict[str, Any]:
    session, log = result.session, result.log
    sampled = log.every(0.1)
    true, time = log.true[sampled], log.time[sampled]
    late = time >= time[-1] - _RECENT
    recent = true[late]
    turned = np.abs([wrap_angle(step) for step in np.diff(recent[:, 2])]).sum()
    goals = [(goal.x, goal.y) for goal in session.mission.goals]
    task = session.task
    remaining = _remaining(session.plan, true, goals, task.success_radius, task.robot.radius)
    return {
        "driven": path_length(true),
        "gained": session.shortest - remaining,
        "recent": float(time[-1] - time[late][0]),
        "recent_driven": path_length(recent),
        "recent_turned": float(turned),
        "vetoed": float(log.vetoed[_late(log)].mean()),
    }


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
