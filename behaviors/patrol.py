"""Patrol: the composite behaviour for going round and round past the same waypoints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from navfw import Context, RuledComposite


class Patrol(RuledComposite):
    """Cruises in the middle of the way, and is cautious where someone may come along.

    Unlike ``travel`` it gives comfort a say (``cruise``, ``centre_corridor``) as long as all goes
    well; when nothing gets on, it does as ``travel`` does.
    """

    name: ClassVar[str] = "patrol"

    def inputs(self, context: Context) -> Mapping[str, float]:
        """What the rules judge by."""
        return {
            "idle": context.idle,
            "barred": context.barred,
            "corridor": context.ranges.corridor,
            "door": context.door_distance,
            "nearest": context.ranges.nearest(-1.2, 1.2),
        }
