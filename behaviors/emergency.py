"""Emergency: stop, back out along the way just driven, then turn to where it is free."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw import Array, Behavior, BehaviorRules, Context, Explain, Proposal, RobotModel


class Emergency(Behavior):
    """Takes over when contact is imminent, the wheels are blocked, or the robot is boxed in.

    It backs out as far as the way behind is known to be free (moving backwards shows depth, too:
    ghosts before the robot are seen through), then turns to the freest direction (METHOD 2.12,
    3.7).
    """

    name: ClassVar[str] = "emergency"

    class Params(Behavior.Params):
        """How an alarm is answered."""

        threshold: Annotated[
            float, Field(gt=0.0, lt=1.0, description="alarm from which it takes over")
        ] = 0.5
        backing: Annotated[float, Field(ge=0.0, le=1.0, description="way to back out [m]")] = 0.2
        turn: Annotated[float, Field(ge=0.0, le=3.2, description="turn after it [rad]")] = 0.6
        patience: Annotated[
            float, Field(gt=0.0, le=20.0, description="longest time for one rescue [s]")
        ] = 5.0

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self.rules = BehaviorRules.beside(__file__)
        self.reset()

    def reset(self) -> None:
        """No rescue under way."""
        self._since: float | None = None
        self._phase = "watch"
        self._origin = (0.0, 0.0, 0.0)
        self._target = 0.0
        self._still_since: float | None = None

    def propose(self, context: Context) -> Proposal:
        """Watch; when alarmed forbid driving forward and lead the way out."""
        verdict = self.rules.evaluate(
            contact=self._contact(context),
            stalled=context.stalled,
            standing=self._standing(context),
        )
        alarm = verdict.value("alarm")
        if self._phase == "watch" and alarm > self.params.threshold:
            self._begin(context)
        if self._phase == "watch":
            nothing = context.commands.zeros()
            return Proposal(0.0, nothing, nothing, "nothing to fear", explain=verdict.explain)
        return self._rescue(context, explain=verdict.explain)

    def _contact(self, context: Context) -> float:
        """Time until contact on the present course over the time needed to stop."""
        v = context.twist.v
        if v < 0.05:
            return 5.0
        free = float(context.arcs.free[context.commands.nearest(context.twist)])
        stopping = v / self.robot.max_brake + 0.15
        return min(5.0, free / v / stopping)

    def _standing(self, context: Context) -> float:
        """How long [s] the robot has stood still although it has somewhere to go."""
        moving = abs(context.twist.v) > 0.02 or abs(context.twist.w) > 0.15
        if context.waypoint is None or context.previous is None or moving:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = context.time
        return 0.0 if self._still_since is None else context.time - self._still_since

    def _begin(self, context: Context) -> None:
        """Start a rescue from here."""
        self._since = context.time
        self._phase = "back"
        self._origin = (context.pose.x, context.pose.y, context.pose.yaw)
        self._still_since = None

    def _rescue(self, context: Context, explain: Explain) -> Proposal:
        """Back out, then turn; forward is forbidden meanwhile."""
        commands = context.commands
        forbid = commands.zeros()
        forbid[commands.v > 0.0, :] = 1.0
        behind = context.arcs.free[0] if commands.v[0] < 0.0 else np.zeros(commands.w.size)
        way = math.hypot(context.pose.x - self._origin[0], context.pose.y - self._origin[1])
        if self._phase == "back" and (
            way >= self.params.backing or float(behind[commands.w.size // 2]) < 0.08
        ):
            self._phase = "turn"
            self._target = context.pose.yaw + self._freest(context)
        desire = self._backwards(context) if self._phase == "back" else self._turning(context)
        over = self._since is not None and context.time - self._since > self.params.patience
        if over or (self._phase == "turn" and abs(self._left(context)) < 0.1):
            self._phase = "watch"
        return Proposal(
            applicability=1.0,
            desirability=desire,
            prohibition=forbid,
            reason="backing out" if self._phase == "back" else "turning to where it is free",
            explain=explain,
        )

    def _freest(self, context: Context) -> float:
        """Turn [rad] toward the freest direction, the nearer to the aim the better."""
        ranges = context.ranges
        aim = 0.0 if context.aim is None else context.aim.bearing
        away = np.abs((ranges.bearings - aim + math.pi) % (2 * math.pi) - math.pi)
        best = float(ranges.bearings[int(np.argmax(ranges.free - 0.3 * away))])
        least = self.params.turn
        return math.copysign(max(abs(best), least), best)

    def _left(self, context: Context) -> float:
        """The turn [rad] still to make."""
        return (self._target - context.pose.yaw + math.pi) % (2 * math.pi) - math.pi

    def _backwards(self, context: Context) -> Array:
        """Straight back, slowly."""
        commands = context.commands
        speed = np.where(commands.v < 0.0, 1.0, 0.0)
        turn = np.maximum(0.0, 1.0 - np.abs(commands.relative_w) / 0.3)
        return commands.product(speed, turn)

    def _turning(self, context: Context) -> Array:
        """On the spot toward the target."""
        commands = context.commands
        speed = np.where(commands.v == 0.0, 1.0, 0.0)
        wanted = min(1.0, max(-1.0, self._left(context) / 0.6))
        turn = np.maximum(0.0, 1.0 - np.abs(commands.relative_w - wanted) / 0.3)
        return commands.product(speed, turn)
