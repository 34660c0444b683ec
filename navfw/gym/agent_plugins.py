"""How an agent acts: plugins of the stack that answer with the agent's last action."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from navfw.context import Context
from navfw.interfaces import Composite, Fusion, Plugin
from navfw.robot import RobotModel
from navfw.signals import Command, Proposal, Twist
from navfw.stack import Stack

Action = Literal["twist", "weights"]
"""What an agent decides: the twist in the place of fusion, or the composite's weights."""


AgentChoice = npt.NDArray[np.float32]
"""An element of a space of actions."""


class AgentCommand(Fusion):
    """Commands the twist that an agent has chosen, whatever the behaviours propose."""

    name: ClassVar[str] = "agent_command"

    def __init__(self, robot: RobotModel, params: Plugin.Params | None = None) -> None:
        super().__init__(robot, params)
        self.reset()

    def reset(self) -> None:
        """Back to standstill, until the first action."""
        self.twist = Twist(0.0, 0.0)

    def fuse(self, context: Context, proposals: Mapping[str, Proposal]) -> Command:
        """The agent's command."""
        return Command(context.time, self.twist, "agent", "the agent's action")


class AgentWeights(Composite):
    """Weighs the behaviours as an agent has chosen."""

    name: ClassVar[str] = "agent_weights"

    def __init__(self, robot: RobotModel, params: Plugin.Params | None = None) -> None:
        super().__init__(robot, params)
        self.reset()

    def reset(self) -> None:
        """Back to full weight for all behaviours, until the first action."""
        self.weights: Mapping[str, float] = {}

    def weigh(self, context: Context) -> Mapping[str, float]:
        """The agent's weights."""
        return self.weights


class AgentAction(ABC):
    """A kind of action: its space, the stack's stage that it replaces, and how it takes effect."""

    plugin: ClassVar[type[Plugin]]
    space: spaces.Box

    @abstractmethod
    def __init__(self, stack: Stack) -> None:
        """The kind of action for robots and behaviours like those of ``stack``."""

    @abstractmethod
    def apply(self, stack: Stack, action: AgentChoice) -> None:
        """Let ``action``, an element of ``space``, hold from the next decision of ``stack`` on."""

    @classmethod
    def overrides(cls) -> tuple[str, ...]:
        """The changes of a stack that put the agent's plugin into it, as with ``--set``."""
        return (f"{cls.plugin.kind}={cls.plugin.name}",)


class TwistAction(AgentAction):
    """(2,) in [-1, 1]: speed and turning rate, in units of the largest of the command grid.

    1 is the top speed and the top turning rate to the left, -1 the top speed backwards and the top
    turning rate to the right.
    """

    plugin = AgentCommand

    def __init__(self, stack: Stack) -> None:
        self.space = spaces.Box(-1.0, 1.0, (2,), np.float32)

    def apply(self, stack: Stack, action: AgentChoice) -> None:
        """Command the twist."""
        commands = stack.mofis.commands
        speed, turn = (float(value) for value in action)
        v = speed * (commands.max_v if speed > 0.0 else -float(commands.v[0]))
        cast(AgentCommand, stack.mofis.fusion).twist = Twist(v, turn * commands.max_w)


class WeightsAction(AgentAction):
    """(n,) in [0, 1]: the weight of each behaviour, in the order of the stack file."""

    plugin = AgentWeights

    def __init__(self, stack: Stack) -> None:
        self.space = spaces.Box(0.0, 1.0, (len(stack.mofis.behaviors),), np.float32)

    def apply(self, stack: Stack, action: AgentChoice) -> None:
        """Weigh the behaviours."""
        weights = dict(zip(stack.mofis.behaviors, map(float, action), strict=True))
        cast(AgentWeights, stack.mofis.composite).weights = weights


ACTIONS: dict[str, type[AgentAction]] = {"twist": TwistAction, "weights": WeightsAction}
"""The kinds of action by name."""
