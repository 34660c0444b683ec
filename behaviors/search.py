"""Search: the composite behaviour of a robot that is not sure where it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from navfw import Context, RuledComposite


class Search(RuledComposite):
    """Travels while it knows where it is; else looks round for landmarks, then explores for them.

    One turn on the spot, a stretch toward the unknown, another turn, and so on, until the belief
    is sure again. What is sought in vain for long is given up for a while: the robot travels on,
    unless it does not know at all where it is.
    """

    name: ClassVar[str] = "search"

    class Params(RuledComposite.Params):
        """When it searches, and how long."""

        sigma: Annotated[
            float, Field(gt=0.0, le=20.0, description="standard deviation that is doubtful [m]")
        ] = 0.6
        stretch: Annotated[
            float, Field(gt=0.0, le=50.0, description="way explored until it looks round again [m]")
        ] = 2.0
        patience: Annotated[
            float, Field(gt=0.0, le=3600.0, description="time until the search is in vain [s]")
        ] = 60.0
        rest: Annotated[
            float, Field(ge=0.0, le=3600.0, description="time travelled after a search in vain [s]")
        ] = 60.0

    params: Params

    def reset(self) -> None:
        """Nothing is being sought."""
        super().reset()
        self._since: float | None = None
        self._time = 0.0
        self._turned = self._driven = 0.0

    def inputs(self, context: Context) -> Mapping[str, float]:
        """What the rules judge by: those of ``travel``, and how the search goes."""
        lost = context.belief.lost
        doubt = 2.0 if lost else context.belief.sigma / self.params.sigma
        searched = self._keep_account(context, doubtful=doubt >= 1.0)
        return {
            "doubt": doubt,
            "looked": self._turned >= 2.0 * math.pi,
            # who is lost has nowhere to travel to
            "searched": 0.0 if lost else searched / self.params.patience,
            "idle": context.idle,
            "barred": context.barred,
            "corridor": context.ranges.corridor,
            "door": context.door_distance,
        }

    def _keep_account(self, context: Context, *, doubtful: bool) -> float:
        """Time [s] since the search began; turn and way since the robot last looked round."""
        elapsed = context.time - self._time
        self._time = context.time
        if not doubtful:
            self._since = None
            self._turned = self._driven = 0.0
            return 0.0
        if self._since is None or context.time - self._since > self.params.patience + (
            self.params.rest
        ):
            self._since, elapsed = context.time, 0.0
            self._turned = self._driven = 0.0
        round_once = self._turned >= 2.0 * math.pi
        self._turned += 0.0 if round_once else abs(context.twist.w) * elapsed
        self._driven += abs(context.twist.v) * elapsed if round_once else 0.0
        if self._driven >= self.params.stretch:
            self._turned = self._driven = 0.0
        return context.time - self._since
