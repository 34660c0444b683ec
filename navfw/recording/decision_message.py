"""Encode and decode a decision: the inputs of behaviours and fusion, and their command.

It has all that shipped behaviours use, bit by bit: with it a decision is made again without the
images and the perception before it. In `office` these messages are 7 % of a recording, and writing
them takes 0.7 % of the loop. A state from which the whole stack could continue has some megabytes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from navfw.context import CommandGrid, Context
from navfw.localmap import Arcs, LocalGoal, Ranges
from navfw.numerics import Array
from navfw.recording.channel_list import DECISION_NAME
from navfw.recording.ros_messages import message_types, ros_message
from navfw.robot import RobotModel
from navfw.signals import Belief, Command, Conflicts, Percept, Pose, Twist, Waypoint
from navfw.signals.percepts import Label

_TERMS = ("near", "middle", "far")
"""The degrees that a quadrant has."""
T = TypeVar("T")


def encoded_decision(context: Context, twist: Twist) -> bytes:
    """Encode a decision: its context, and the command's ``twist``.

    ``values`` are JSON. The flow is left out, and of the percept all but its time, the cells that
    show an obstacle, the quadrants, and the degree of the floor in front.
    """
    arcs, ranges, percept, belief = context.arcs, context.ranges, context.percept, context.belief
    goal, waypoint, conflicts = context.local_goal, context.waypoint, context.conflicts
    layers = [arcs.free, arcs.observed, arcs.clearance, arcs.turn]
    layers += [ranges.bearings, ranges.free, ranges.observed]
    place = belief.covariance[[0, 0, 1], [0, 1, 1]].tolist()
    values = {
        "time": context.time,
        "command": _row(twist),
        "twist": _row(context.twist),
        "pose": _row(context.pose),
        "belief": [_row(belief.pose), place, belief.confidence, belief.lost],
        "previous": None,
        "waypoint": None if waypoint is None else _row(waypoint),
        "local_goal": None if goal is None else _row(goal),
        "arcs": arcs.reach,
        "ranges": [ranges.limit, ranges.bearings.size],
        "stalled": context.stalled,
        "idle": context.idle,
        "conflicts": None,
        "percept": None,
    }
    if context.previous is not None:
        was = context.previous
        values["previous"] = [_row(was.twist), was.leader, was.emergency]
    if conflicts is not None:
        layers += [conflicts.distance, conflicts.time, conflicts.approach]
        values["conflicts"] = conflicts.nearest
    labels = np.empty(0, dtype=np.uint8)
    if percept is not None:
        shown = percept.label == Label.OBSTACLE
        layers += [percept.nearness[shown], percept.confidence[shown]]
        labels = percept.label.ravel().view(np.uint8)
        quadrants = {name: list(of.values()) for name, of in percept.quadrants.items()}
        obstacles = {name: dict(regions) for name, regions in percept.obstacles.items()}
        seen = percept.time, percept.label.shape[1], quadrants, obstacles, percept.floor_in_front
        values["percept"] = seen
    numbers = np.concatenate([layer.ravel() for layer in layers])
    fields = {"values": json.dumps(values), "numbers": numbers, "labels": labels}
    return ros_message(DECISION_NAME, fields)


def decision_of(message: bytes, robot: RobotModel, commands: CommandGrid) -> tuple[Context, Twist]:
    """Decode context and command; reading a field that ``message`` lacks raises AttributeError."""
    parts: Any = message_types().deserialize_cdr(message, DECISION_NAME)
    values, place = json.loads(parts.values), 0

    def take(*shape: int) -> Array:
        nonlocal place
        begin, place = place, place + int(np.prod(shape))
        return np.asarray(parts.numbers[begin:place].reshape(shape))

    grid, turns = commands.shape, commands.shape[1]
    limit, rays = values["ranges"]
    arcs = Arcs(take(*grid), take(*grid), take(*grid), take(turns), values["arcs"])
    ranges = Ranges(take(rays), take(rays), take(rays), limit)
    conflicts = None
    if values["conflicts"] is not None:
        conflicts = Conflicts(take(*grid), take(*grid), take(*grid), values["conflicts"])
    pose, (xx, xy, yy), confidence, lost = values["belief"]
    covariance = np.full((3, 3), np.nan)
    covariance[:2, :2] = (xx, xy), (xy, yy)
    if (previous := values["previous"]) is not None:
        driven, leader, emergency = previous
        known = {"leader": leader, "emergency": emergency}
        previous = _partly(Command, twist=Twist(*driven), **known)
    belief = {"pose": Pose(*pose), "covariance": covariance, "confidence": confidence}
    context = _partly(
        Context,
        time=values["time"],
        robot=robot,
        commands=commands,
        twist=Twist(*values["twist"]),
        pose=Pose(*values["pose"]),
        belief=_partly(Belief, time=values["time"], lost=lost, **belief),
        percept=_percept(values["percept"], parts.labels.view(np.int8), take),
        arcs=arcs,
        ranges=ranges,
        waypoint=_optional(Waypoint, values["waypoint"]),
        local_goal=_optional(LocalGoal, values["local_goal"]),
        previous=previous,
        stalled=values["stalled"],
        idle=values["idle"],
        conflicts=conflicts,
    )
    return context, Twist(*values["command"])


def _percept(seen: Sequence[Any] | None, labels: Any, take: Callable[[int], Array]) -> Any:
    if seen is None:
        return None
    time, columns, quadrants, obstacles, floor_in_front = seen
    label = labels.reshape(-1, columns)
    shown = label == Label.OBSTACLE
    nearness, confidence = np.full((2, *label.shape), np.nan)
    for grid in (nearness, confidence):
        grid[shown] = take(int(shown.sum()))
    cells = {"label": label, "nearness": nearness, "confidence": confidence}
    degrees = {name: dict(zip(_TERMS, of, strict=True)) for name, of in quadrants.items()}
    fuzzy = {"quadrants": degrees, "obstacles": obstacles, "floor_in_front": floor_in_front}
    return _partly(Percept, time=time, **cells, **fuzzy)


def _row(value: Any) -> list[Any]:
    """Return the fields of a dataclass, in their order."""
    return [getattr(value, name) for name in value.__dataclass_fields__]


def _optional(kind: Callable[..., T], row: Sequence[Any] | None) -> T | None:
    return None if row is None else kind(*(tuple(v) if isinstance(v, list) else v for v in row))


def _partly(kind: type[T], **known: Any) -> T:
    """Return an instance of which only these fields are ``known``."""
    made = object.__new__(kind)
    for name, value in known.items():
        object.__setattr__(made, name, value)
    return made
