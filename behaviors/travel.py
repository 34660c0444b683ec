"""Travel: the composite behaviour for going from waypoint to waypoint (paper Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from navfw import BehaviorRules, Composite, Context, Explain, RobotModel


class Travel(Composite):
    """Weighs the primitives by whether the robot gets on, and what it drives through."""

    name: ClassVar[str] = "travel"

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
        verdict = self.rules.evaluate(
            idle=context.idle,
            barred=float(context.barred),
            corridor=context.ranges.corridor,
            door=context.door_distance,
        )
        self._fired = verdict.explain
        return {name: verdict.degree(name) for name in self.rules.outputs}

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """The rules that fired for the last weights."""
        return () if self._fired is None else self._fired(0, 0)
