"""The outline of a world for pictures and recordings."""

from __future__ import annotations

from navfw.recording.top_view import OutlineDisc, WorldOutline
from navfw.sim.floorplan import FloorPlan


def outline_of(plan: FloorPlan) -> WorldOutline:
    """The outline of the world in a top view: walls, doors, furniture and drops."""
    rectangles = list(plan.rectangles())
    return WorldOutline(
        walls=[corners for solid, corners in rectangles if solid.kind in {"wall", "door"}],
        furniture=[
            corners for solid, corners in rectangles if solid.kind in {"box", "mesh", "drop"}
        ],
        discs=[OutlineDisc(circle.x, circle.y, circle.radius) for _, circle in plan.circles()],
    )
