"""How an agent acts: plugins of the stack that answer with the agent's last action."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

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
    """Commands the twist that an agent has chosen, whatever the behaviours propose.

    An action is (2,) in [-1, 1]: speed and turning rate, in units of the largest of the command
    grid. 1 is the top speed and the top turning rate to the left, -1 the top speed backwards and
    the top turning rate to the right.
    """

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

    @staticmethod
    def action_space(stack: Stack) -> spaces.Box:
        """The actions for stacks like ``stack``."""
        return spaces.Box(-1.0, 1.0, (2,), np.float32)

    def act(self, stack: Stack, action: AgentChoice) -> None:
        """Let ``action`` hold from the next decision of ``stack`` on."""
        commands = stack.mofis.commands
        speed, turn = (float(value) for value in action)
        v = speed * (commands.max_v if speed > 0.0 else -float(commands.v[0]))
        self.twist = Twist(v, turn * commands.max_w)


class AgentWeights(Composite):
    """Weighs the behaviours as an agent has chosen.

    An action is (n,) in [0, 1]: the weight of each behaviour, in the order of the stack file.
    """

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

    @staticmethod
    def action_space(stack: Stack) -> spaces.Box:
        """The actions for stacks like ``stack``."""
        return spaces.Box(0.0, 1.0, (len(stack.mofis.behaviors),), np.float32)

    def act(self, stack: Stack, action: AgentChoice) -> None:
        """Let ``action`` hold from the next decision of ``stack`` on."""
        self.weights = dict(zip(stack.mofis.behaviors, map(float, action), strict=True))


ACTIONS: dict[str, type[AgentCommand | AgentWeights]] = {
    "twist": AgentCommand,
    "weights": AgentWeights,
}
"""The plugin of each kind of action, by its name."""
