"""The page of a running mission: what does not change while it runs; ``live_page.js`` shows it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from navfw.numerics import Array
from navfw.recording import palette, top_view
from navfw.recording.channel_list import SeenRun
from navfw.recording.run_folder import plain_json
from navfw.report.report_page import render_page


def live_page(title: str, seen: SeenRun, goals: list[tuple[float, float]]) -> str:
    """The page (HTML) that ``LiveServer`` serves of a run to ``goals`` (x, y) [m, map frame]."""
    stack, outline = seen.stack, seen.outline
    places = sorted(stack.topo_map.places.values(), key=lambda place: place.kind != "room")
    named = [(place.name, place.x, place.y) for place in places]
    bounds = outline.bounds(0.2, np.array([*goals, *((p.x, p.y) for p in places)]))
    shapes = (*outline.shapes(), top_view.goal_marks(goals))
    data = {
        **plan_data(shapes, bounds, named, stack.mofis.behaviors),
        "discs": stack.robot.discs,
        "flow": palette.FLOW,
        "v": [stack.mofis.commands.v.min(), stack.mofis.commands.v.max()],
        "w": [stack.mofis.commands.w.min(), stack.mofis.commands.w.max()],
    }
    shown = plain_json(data)
    return render_page("live_page.html", title=title, data=shown, cells=palette.camera_key())


def plan_data(
    shapes: Iterable[top_view.Shape],
    bounds: tuple[Array, Array],
    places: Sequence[tuple[str, float, float]],
    behaviors: Iterable[str],
) -> dict[str, Any]:
    """What ``page_drawing.js`` draws a plan of: ``shapes`` and ``places`` (name, x, y) within.

    ``bounds`` are the lowest and highest x, y [m]; ``behaviors`` get their colours.
    """
    return {
        "bounds": [*bounds[0], *bounds[1]],
        "shapes": [_drawn(shape) for shape in shapes],
        "places": places,
        "colors": {name: palette.behavior_color(name) for name in ("none", *behaviors)},
        "goal": palette.GOAL,
        "estimate": palette.ESTIMATE,
        "moving": palette.MOVING,
        "contact": palette.CONTACT,
    }


def _drawn(shape: top_view.Shape) -> dict[str, Any]:
    """A shape as the page's script draws it."""
    style = shape.style
    drawn: dict[str, Any] = {"fill": style.color, "edge": style.edge, "width": style.width}
    if isinstance(shape, top_view.Disc):
        return drawn | {"discs": [(shape.x, shape.y, shape.radius)]}
    points = shape.corners if isinstance(shape, top_view.Area) else shape.points
    return drawn | {"marks" if isinstance(shape, top_view.Marks) else "area": points.tolist()}
