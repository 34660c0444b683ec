"""Patrol: the composite behaviour for repeated rounds past the same waypoints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from navfw import Context, RuledComposite


class Patrol(RuledComposite):
    """Cruises in the middle of corridors, slower at doors and beside obstacles.

    Unlike ``travel`` it weighs comfort (``cruise``, ``centre_corridor``) while there is progress;
    without progress its weights are those of ``travel``.
    """

    name: ClassVar[str] = "patrol"

    def inputs(self, context: Context) -> Mapping[str, float]:
        """Return progress, barred path, corridor, door and nearest obstacle for the rules."""
        return {
            "idle": context.idle,
            "barred": context.barred,
            "corridor": context.ranges.corridor,
            "door": context.door_distance,
            "nearest": context.ranges.nearest(-1.2, 1.2),
        }
