"""Observations and actions of an agent.

It observes only what the stack itself senses, infers and believes. Every observation is a
dictionary with ``waypoint`` and ``twist``, and the entries of one kind. Arrays are float32 unless
said otherwise. Unknown values are 0, with a confidence of 0. The agent's last action is the answer
of a plugin of the stack.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import cv2
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from navfw.context import Context
from navfw.errors import ConfigError
from navfw.interfaces import Composite, Fusion
from navfw.localmap import CLAMP_MAX, CLAMP_MIN
from navfw.missions.pilot import TickView
from navfw.numerics import Array
from navfw.offis.elementary_situations import ELEMENTARY, TABLE
from navfw.signals import Command, Label, Pose, Proposal, Twist
from navfw.stack import Stack

Action = Literal["twist", "weights"]
"""What an agent decides: the twist, instead of fusion, or the weights, instead of the composite."""

AgentChoice = npt.NDArray[np.float32]
"""An action: an element of a space of actions."""


class AgentCommand(Fusion):
    """A fusion that commands the twist chosen by an agent; no behaviour is called.

    An action is (2,) in [-1, 1]: speed and turning rate, in units of the largest of the command
    grid. 1 is the top speed and the top turning rate to the left, -1 the top speed backwards and
    the top turning rate to the right.
    """

    name: ClassVar[str] = "agent_command"
    needs_proposals: ClassVar[bool] = False
    needs_room: ClassVar[bool] = False

    twist: Twist = Twist(0.0, 0.0)

    def reset(self) -> None:
        """Command standstill until the first action."""
        self.twist = Twist(0.0, 0.0)

    def fuse(self, context: Context, proposals: Mapping[str, Proposal]) -> Command:
        """Return the agent's command."""
        return Command(context.time, self.twist, "agent", "the agent's action")

    @staticmethod
    def action_space(stack: Stack) -> spaces.Box:
        """Return the space of actions for stacks like ``stack``."""
        return spaces.Box(-1.0, 1.0, (2,), np.float32)

    def act(self, stack: Stack, action: AgentChoice) -> None:
        """Apply ``action`` from the next decision of ``stack`` on."""
        commands = stack.mofis.commands
        speed, turn = (float(value) for value in action)
        v = speed * (commands.max_v if speed > 0.0 else -float(commands.v[0]))
        self.twist = Twist(v, turn * commands.max_w)


class AgentWeights(Composite):
    """A composite that weighs the behaviours as chosen by an agent.

    An action is (n,) in [0, 1]: the weight of each behaviour, in the order of the stack file.
    """

    name: ClassVar[str] = "agent_weights"

    weights: Mapping[str, float] = MappingProxyType({})

    def reset(self) -> None:
        """Give all behaviours full weight until the first action."""
        self.weights = {}

    def weigh(self, context: Context) -> Mapping[str, float]:
        """Return the agent's weights."""
        return self.weights

    @staticmethod
    def action_space(stack: Stack) -> spaces.Box:
        """Return the space of actions for stacks like ``stack``."""
        return spaces.Box(0.0, 1.0, (len(stack.mofis.behaviors),), np.float32)

    def act(self, stack: Stack, action: AgentChoice) -> None:
        """Apply ``action`` from the next decision of ``stack`` on."""
        self.weights = dict(zip(stack.mofis.behaviors, map(float, action), strict=True))


ACTIONS: dict[str, type[AgentCommand | AgentWeights]] = {
    "twist": AgentCommand,
    "weights": AgentWeights,
}
"""The plugin of each kind of action, by its name."""


Observation = Literal["image", "flow", "percept", "local_map"]
"""The kinds of observation."""

MAX_DISTANCE = 50.0
"""Distance [m] at which the coordinates of the waypoint are clipped."""

_MAX_NEARNESS = 20.0
"""Nearness [1/m] at which percepts are clipped: 5 cm from the camera."""

MAX_HEIGHT = 5.0
"""Height [m] above and below the floor at which the heights of percepts are clipped."""

_QUADRANTS = ("P1", "P2", "P3", "P4")
_TERMS = ("near", "middle", "far")
_SITUATIONS = tuple(dict.fromkeys((*TABLE, *ELEMENTARY)))


def _box(low: float, high: float, *shape: int) -> spaces.Box:
    return spaces.Box(low, high, shape, np.float32)


def _clipped(values: Any, box: spaces.Box) -> Array:
    """Return ``values`` as an element of ``box``; what is not a number becomes 0."""
    clipped: Array = np.array(values, box.dtype)
    if box.dtype == np.float32:
        clipped[np.isnan(clipped)] = 0.0
        # equal to np.clip, at a third of its cost on arrays of the size of a grid
        np.minimum(np.maximum(clipped, box.low, out=clipped), box.high, out=clipped)
    return clipped


class ImageObservation:
    """``image`` (height, width) uint8: the newest frame of the camera, as the robot gets it."""

    def __init__(self, stack: Stack) -> None:
        camera = stack.robot.camera
        self.spaces = {"image": spaces.Box(0, 255, (camera.height, camera.width), np.uint8)}

    def read(self, tick: TickView, stack: Stack) -> dict[str, Any]:
        """Return the image if a frame came with this tick."""
        return {} if tick.image is None else {"image": tick.image}


class FlowObservation:
    """``flow`` (2, rows, cols) [px] derotated, x right and y down; ``flow_confidence`` in [0, 1].

    Vectors are clipped to half the image's width.
    """

    def __init__(self, stack: Stack) -> None:
        grid = _grid_of(stack)
        reach = 0.5 * stack.robot.camera.width
        self.spaces = {"flow": _box(-reach, reach, 2, *grid), "flow_confidence": _box(0, 1, *grid)}

    def read(self, tick: TickView, stack: Stack) -> dict[str, Any]:
        """Return the newest flow."""
        if tick.flow is None:
            return {}
        vectors = np.moveaxis(tick.flow.vectors, -1, 0)
        return {"flow": vectors, "flow_confidence": tick.flow.confidence}


class PerceptObservation:
    """OFFIS' percept: arrays (rows, cols), and degrees in [0, 1].

    ``nearness`` [1/m], ``confidence`` in [0, 1], ``height`` [m], ``label`` int8 (the values of
    ``navfw.signals.Label``); ``quadrants`` (4, 3) of near, middle, far in P1 to P4; ``situations``
    (n,) of Table 1 and the elementary situations, in the order of
    ``navfw.offis.elementary_situations``.
    """

    def __init__(self, stack: Stack) -> None:
        grid = _grid_of(stack)
        self.spaces = {
            "nearness": _box(0.0, _MAX_NEARNESS, *grid),
            "confidence": _box(0.0, 1.0, *grid),
            "height": _box(-MAX_HEIGHT, MAX_HEIGHT, *grid),
            "label": spaces.Box(min(Label), max(Label), grid, np.int8),
            "quadrants": _box(0.0, 1.0, len(_QUADRANTS), len(_TERMS)),
            "situations": _box(0.0, 1.0, len(_SITUATIONS)),
        }

    def read(self, tick: TickView, stack: Stack) -> dict[str, Any]:
        """Return the newest percept."""
        seen = tick.percept
        if seen is None:
            return {}
        degrees = [[seen.quadrants.get(q, {}).get(t, 0.0) for t in _TERMS] for q in _QUADRANTS]
        return {
            "nearness": seen.nearness,
            "confidence": seen.confidence,
            "height": seen.height,
            "label": seen.label,
            "quadrants": degrees,
            "situations": [seen.situations.get(name, 0.0) for name in _SITUATIONS],
        }


class LocalMapObservation:
    """``local_map`` (n, n): log-odds of occupancy around the robot, 0 where nothing is known.

    The rows go from ahead of the robot (row 0) to behind it, the columns from its left to its
    right; the robot is in the middle. Cells have the size of the stack's local map.
    """

    def __init__(self, stack: Stack) -> None:
        grid = stack.local_map.occupancy
        low, high = CLAMP_MIN, CLAMP_MAX
        self.spaces = {"local_map": _box(low, high, grid.size, grid.size)}

    def read(self, tick: TickView, stack: Stack) -> dict[str, Any]:
        """Return the local map, turned into the robot's axes."""
        grid, odometry = stack.local_map.occupancy, tick.state.odometry
        if odometry is None or not grid.located:
            return {}
        at = _cells_of(odometry.pose, grid.origin, grid.params.cell, grid.size)
        nearest = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        cells = grid.log_odds.astype(np.float32)
        return {"local_map": cv2.warpAffine(cells, at, cells.shape, flags=nearest)}


def _cells_of(pose: Pose, origin: tuple[float, float], cell: float, size: int) -> Array:
    """(2, 3): from (column, row) around the robot to (column, row) of the grid in odom axes."""
    middle, cos, sin = size // 2, math.cos(pose.yaw), math.sin(pose.yaw)
    # of a cell, the metres ahead are (middle - row) * cell, to the left (middle - column) * cell
    column, row = (pose.x - origin[0]) / cell, (pose.y - origin[1]) / cell
    return np.array(
        [
            [sin, -cos, column + (cos - sin) * middle],
            [-cos, -sin, row + (cos + sin) * middle],
        ]
    )


def _grid_of(stack: Stack) -> tuple[int, int]:
    """(rows, cols) of the flow's grid."""
    choice = stack.resolved.stages["flow"]
    rows, cols = (getattr(choice.params, name, None) for name in ("rows", "cols"))
    if rows is None or cols is None:
        what = f"{choice.name} has no parameters rows and cols, so its grid is not known beforehand"
        raise ConfigError(f"{what}; observe image or local_map", key="observation")
    return int(rows), int(cols)


ObservationKind = ImageObservation | FlowObservation | PerceptObservation | LocalMapObservation
"""Has ``spaces`` by name, and ``read``, their values at a tick; those left out are 0."""

KINDS: dict[str, type[ObservationKind]] = {
    "image": ImageObservation,
    "flow": FlowObservation,
    "percept": PerceptObservation,
    "local_map": LocalMapObservation,
}
"""The kinds of observation by name."""


class AgentView:
    """Makes observations of one kind with ``waypoint`` and ``twist``.

    ``waypoint`` (2,) [m]: the next waypoint in base_link, ahead and left, according to the stack's
    belief; 0, 0 without one. ``twist`` (2,): the measured v [m/s] and w [rad/s].
    """

    def __init__(self, kind: ObservationKind, stack: Stack) -> None:
        v, w = max(stack.robot.max_v, stack.robot.max_reverse), stack.robot.max_w
        limits = np.array([2.0 * v, 2.0 * w], np.float32)
        self._kind = kind
        self._boxes = {
            "waypoint": _box(-MAX_DISTANCE, MAX_DISTANCE, 2),
            "twist": spaces.Box(-limits, limits, dtype=np.float32),
            **kind.spaces,
        }
        self.space = spaces.Dict(dict(self._boxes))

    def read(self, tick: TickView, stack: Stack) -> dict[str, Any]:
        """Return the observation at a tick."""
        state, values = tick.state, self._kind.read(tick, stack)
        if state.waypoint is not None and state.belief is not None:
            values["waypoint"] = state.belief.pose.to_local(state.waypoint.x, state.waypoint.y)
        if state.odometry is not None:
            values["twist"] = state.odometry.twist.v, state.odometry.twist.w
        return {
            name: _clipped(values[name], box) if name in values else np.zeros(box.shape, box.dtype)
            for name, box in self._boxes.items()
        }
