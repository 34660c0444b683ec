"""Patrol: the composite behaviour for going round and round past the same waypoints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from navfw import BehaviorRules, Composite, Context, Explain, RobotModel


class Patrol(Composite):
    """Cruises in the middle of the way, and is cautious where someone may come along.

    Unlike ``travel`` it gives comfort a say (``cruise``, ``centre_corridor``) as long as all goes
    well; when nothing gets on, it does as ``travel`` does.
    """

    name: ClassVar[str] = "patrol"

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
            nearest=context.ranges.nearest(-1.2, 1.2),
        )
        self._fired = verdict.explain
        return {name: verdict.degree(name) for name in self.rules.outputs}

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """The rules that fired for the last weights."""
        return () if self._fired is None else self._fired(0, 0)
