"""Escape: reverse out, then turn to the freest direction (recovery behaviour)."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from navfw import Context, Explain, Proposal, RuledBehavior

MAX_TIME = 7.0
"""Longest duration of one escape [s]."""
LITTLE = 0.1
"""Length ahead [m] below which the way counts as unseen, and least reverse to look again."""
HELD = 0.15
"""Distance [m] within which the robot goes to and fro."""
REPEAT_TIME = 15.0
"""Time within which the next one repeats it [s]."""


class Escape(RuledBehavior):
    """Frees a trapped robot: reverses over observed floor, then turns to the freest direction.

    Reversing gives depth, too, and clears false obstacles ahead (METHOD 2.12). Each escape soon
    after the last one reverses farther and turns more. Where the way ahead is free but unseen, it
    looks again from farther back, without a turn: turning shows a camera no depth.
    """

    name: ClassVar[str] = "escape"

    class Params(RuledBehavior.Params):
        """Threshold, reverse and turn."""

        threshold: float = Field(0.5, gt=0.0, lt=1.0, description="need that starts it")
        reverse: float = Field(0.25, ge=0.0, le=2.0, description="distance [m]")
        turn: float = Field(0.5, ge=0.0, le=3.2, description="least turn [rad]")

    params: Params

    def reset(self) -> None:
        """Return to watching whether the robot is trapped."""
        self._phase: Literal["watch", "back", "turn"] = "watch"
        self._since = 0.0
        self._ended = -math.inf
        self._tries = 0
        self._looks = False
        self._origin = (0.0, 0.0)
        self._target = 0.0
        self._still_since: float | None = None
        self._barred_since: float | None = None
        self._held_since: float | None = None
        self._held_at = (0.0, 0.0)

    def propose(self, context: Context) -> Proposal:
        """Watch whether the robot is trapped; if so, desire to reverse, then to turn."""
        self._watch(context)
        verdict = self.rules.evaluate(
            standing=_since(self._still_since, context.time),
            held=_since(self._held_since, context.time),
            barred=_since(self._barred_since, context.time),
            idle=context.idle,
        )
        if self._phase == "watch" and verdict.degree("need") > self.params.threshold:
            self._begin(context)
        self._advance(context)
        if self._phase == "watch":
            nothing = context.commands.zeros()
            return Proposal(0.0, nothing, nothing, "not trapped", explain=verdict.explain)
        return self._lead(context, verdict.explain)

    def _watch(self, context: Context) -> None:
        """Update the times since the robot stands, is held on a spot, and every path is barred."""
        still = abs(context.twist.v) < 0.02 and abs(context.twist.w) < 0.2
        if not still or context.waypoint is None or context.previous is None:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = context.time
        at = context.pose.x, context.pose.y
        away = self._held_since is None or math.dist(at, self._held_at) > HELD
        if context.waypoint is None or context.previous is None:
            self._held_since = None
        elif away:
            self._held_since, self._held_at = context.time, at
        if not context.barred:
            self._barred_since = None
        elif self._barred_since is None:
            self._barred_since = context.time

    def _begin(self, context: Context) -> None:
        soon = context.time - self._ended < REPEAT_TIME
        self._tries = self._tries + 1 if soon else 1
        self._phase = "back"
        ahead = -1, context.commands.w.size // 2
        unseen = context.arcs.observed[ahead] < LITTLE <= context.arcs.free[ahead]
        self._looks = bool(unseen) and self._tries % 2 == 1
        self._since = context.time
        self._origin = (context.pose.x, context.pose.y)

    def _advance(self, context: Context) -> None:
        """Advance the phases: reverse, turn, done."""
        looked = False
        if self._phase == "back":
            pose = context.pose
            distance = math.hypot(pose.x - self._origin[0], pose.y - self._origin[1])
            behind = float(context.arcs.free[0, context.commands.w.size // 2])
            if distance >= self.params.reverse * min(self._tries, 4) or behind < 0.05:
                looked = self._looks and distance >= LITTLE
                self._phase = "turn"
                self._target = pose.yaw + self._freest(context)
        turned = self._phase == "turn" and abs(context.turn_to(self._target)) < 0.12
        too_long = context.time - self._since > MAX_TIME
        if self._phase != "watch" and (looked or turned or too_long):
            self._phase = "watch"
            self._ended = context.time
            self._still_since = self._barred_since = self._held_since = None

    def _freest(self, context: Context) -> float:
        """Return the turn [rad] to the freest direction, preferably near the local goal."""
        ranges = context.ranges
        goal = 0.0 if context.local_goal is None else context.local_goal.bearing
        away = np.abs((ranges.bearings - goal + math.pi) % (2 * math.pi) - math.pi)
        best = float(ranges.bearings[int(np.argmax(ranges.free - 0.3 * away))])
        least = min(self.params.turn * self._tries, math.pi)
        return math.copysign(max(abs(best), least), best)

    def _lead(self, context: Context, explain: Explain) -> Proposal:
        """Reverse, or turn on the spot; forward commands are prohibited."""
        commands = context.commands
        if self._phase == "back":
            reason = "reversing"
            desire = commands.product(np.where(commands.v < 0.0, 1.0, 0.0), commands.turning(0.0))
        else:
            reason = "turning to the freest direction"
            turn = context.turn_to(self._target) / 0.6
            desire = commands.on_the_spot(min(1.0, max(-1.0, turn)))
        return Proposal(
            applicability=1.0,
            desirability=desire,
            prohibition=commands.forward(),
            reason=reason,
            explain=explain,
        )


def _since(start: float | None, now: float) -> float:
    return 0.0 if start is None else now - start
