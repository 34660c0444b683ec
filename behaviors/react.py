"""React: the composite behaviour of a robot without memory (paper Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from navfw import BehaviorRules, Composite, Context, Explain, RobotModel


class React(Composite):
    """Seeks the waypoint, and follows walls where it has not come nearer for long.

    It judges by what OFFIS sees just now. A wall is left where the waypoint is nearer than it has
    ever been, as by the Bug algorithms.
    """

    name: ClassVar[str] = "react"

    params: Composite.Params

    def __init__(self, robot: RobotModel, params: Composite.Params | None = None) -> None:
        super().__init__(robot, params)
        self.rules = BehaviorRules.beside(__file__)
        self.reset()

    def reset(self) -> None:
        """Nothing weighed yet."""
        self._fired: Explain | None = None

    def weigh(self, context: Context) -> Mapping[str, float]:
        """The degree of applicability of each primitive named in the rules."""
        sight = context.sight
        nearest = 1.0 if sight is None else min(sight.left, sight.right, sight.ahead)
        ahead = 1.0 if sight is None else sight.ahead
        verdict = self.rules.evaluate(idle=context.idle, nearest=nearest, ahead=ahead)
        self._fired = verdict.explain
        return {name: verdict.degree(name) for name in self.rules.outputs}

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """The rules that fired for the last weights."""
        return () if self._fired is None else self._fired(0, 0)
