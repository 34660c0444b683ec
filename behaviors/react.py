"""React: the composite behaviour of a robot without memory (paper Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from navfw import Context, RuledComposite


class React(RuledComposite):
    """Seeks the waypoint, and follows walls where it has not come nearer for long.

    It judges by what OFFIS sees just now. A wall is left where the waypoint is nearer than it has
    ever been, as by the Bug algorithms.
    """

    name: ClassVar[str] = "react"

    def inputs(self, context: Context) -> Mapping[str, float]:
        """What the rules judge by; where nothing has been seen, nothing is near."""
        sight = context.quadrant_distances
        return {
            "idle": context.idle,
            "nearest": 1.0 if sight is None else min(sight.left, sight.right, sight.ahead),
            "ahead": 1.0 if sight is None else sight.ahead,
        }
