"""Travel: the composite behaviour for going from waypoint to waypoint (paper Fig. 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from navfw import Context, RuledComposite


class Travel(RuledComposite):
    """Weighs the primitives by progress, barred paths, corridors and doors."""

    name: ClassVar[str] = "travel"

    def inputs(self, context: Context) -> Mapping[str, float]:
        """Return progress, barred path, corridor and door as inputs of the rules."""
        return {
            "idle": context.idle,
            "barred": context.barred,
            "corridor": context.ranges.corridor,
            "door": context.door_distance,
        }
