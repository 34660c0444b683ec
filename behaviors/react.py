"""React: the composite behaviour of a robot without a map (paper Fig. 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from navfw import Context, RuledComposite


class React(RuledComposite):
    """Seeks the waypoint, goes through doors, and follows walls when it has not come nearer.

    Its inputs are OFFIS' newest distances, as long as they are recent. Without progress and without
    a recent percept the view has to move first. A wall is left when the waypoint is nearer than
    ever before, as in the Bug algorithms, or faced with nothing near ahead.
    """

    name: ClassVar[str] = "react"

    class Params(RuledComposite.Params):
        """What counts as facing a waypoint."""

        facing: float = Field(
            0.6, gt=0.0, le=3.2, description="largest bearing of a door or goal that is faced [rad]"
        )

    params: Params

    def inputs(self, context: Context) -> Mapping[str, float]:
        """Return the inputs of the rules; without a percept all distances are far."""
        distances = context.quadrant_distances
        waypoint = context.waypoint
        due = waypoint is not None and (waypoint.final or waypoint.kind == "door")
        faced = abs(context.waypoint_bearing) <= self.params.facing
        return {
            "idle": context.idle,
            "age": math.inf if distances is None else distances.age,
            "nearest": 1.0
            if distances is None
            else min(distances.left, distances.right, distances.ahead),
            "ahead": 1.0 if distances is None else distances.ahead,
            "due": context.waypoint_distance if due and faced else math.inf,
            "bearing": abs(context.waypoint_bearing),
        }
