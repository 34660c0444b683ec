"""React: the composite behaviour of a robot without a map (paper Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from navfw import Context, RuledComposite


class React(RuledComposite):
    """Seeks the waypoint, and follows walls when it has not come nearer for a while.

    Its inputs are OFFIS' newest distances. A wall is left when the waypoint is nearer than ever
    before, as in the Bug algorithms.
    """

    name: ClassVar[str] = "react"

    def inputs(self, context: Context) -> Mapping[str, float]:
        """The inputs of the rules; without a percept all distances are far."""
        distances = context.quadrant_distances
        return {
            "idle": context.idle,
            "nearest": 1.0
            if distances is None
            else min(distances.left, distances.right, distances.ahead),
            "ahead": 1.0 if distances is None else distances.ahead,
        }
