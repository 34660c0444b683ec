"""The picture of a map: places and passages over the world's floor plan, optionally a route."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from navfw.config.extras import extra_imports
from navfw.process.atomic import atomic_file
from navfw.recording.palette import GOAL, START
from navfw.recording.path_labels import PathLabels
from navfw.recording.top_view import (
    WorldOutline,
    draw_arrow,
    draw_outline,
    style_axes,
    write_legend,
)
from navfw.signals import Array
from navfw.topomap import TopoMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_KIND_COLORS = {
    "room": "#0072B2",
    "door": "#E69F00",
    "corridor": "#56B4E9",
    "junction": "#009E73",
    "corner": "#8C8577",
    "danger": "#D00000",
}
_PASSAGE, _DANGER, _LANDMARK, _NAME = "#7FA7C9", "#D00000", "#CC79A7", "#3A3A3A"
_ARROWS = 6
"""Number of arrow heads along a route."""
_MAX_WIDTH = 2.0
"""Largest drawn width of a passage [m]."""


class _Point(Protocol):
    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...


class MarkedRoute(Protocol):
    """The part of a route that the picture shows (``navfw.papfis.Route``)."""

    @property
    def start(self) -> _Point:
        """Its start."""
        ...

    @property
    def goal(self) -> _Point:
        """Its end."""
        ...

    @property
    def places(self) -> Sequence[str]:
        """The names of the places on it, in order."""
        ...

    @property
    def length(self) -> float:
        """Its length [m]."""
        ...


def draw_map(
    path: Path,
    topo_map: TopoMap,
    outline: WorldOutline | None = None,
    route: MarkedRoute | None = None,
    avoid: Sequence[Sequence[str]] = (),
) -> None:
    """Write the picture as PNG; passages are drawn to scale, up to a width of 2 m.

    With a ``route`` its places alone are named. ``avoid`` has the two ends of each passage that is
    crossed out.
    """
    with extra_imports("report"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

    points = np.array([(place.x, place.y) for place in topo_map.places.values()])
    corners = [points, *(outline.walls if outline else ()), *(outline.furniture if outline else ())]
    together = np.vstack(corners)
    low, high = together.min(axis=0) - 0.5, together.max(axis=0) + 0.5
    scale = min(16.0 / (high[0] - low[0]), 11.0 / (high[1] - low[1]))
    size = (max((high[0] - low[0]) * scale, 7.0), max((high[1] - low[1]) * scale, 3.0) + 0.9)
    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.04, 0.7 / size[1], 0.94, 1.0 - 1.05 / size[1]))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    if outline is not None:
        draw_outline(axes, outline, edge=0.6, wall_edge=0.4)
    _draw_passages(axes, topo_map, avoid)
    way = np.empty((0, 2))
    if route is not None:
        way = _draw_route(axes, topo_map, route)
    _draw_places(axes, topo_map)
    _draw_landmarks(axes, topo_map)
    labels = PathLabels(axes, way, zorder=9)
    for name in sorted(topo_map.places, key=len) if route is None else route.places:
        labels.write(name, (topo_map.places[name].x, topo_map.places[name].y), _NAME)
    style_axes(axes)
    axes.set_title(_title(topo_map, route), fontsize=11, loc="left")
    write_legend(figure, axes)
    with atomic_file(path, parents=True) as part:
        figure.savefig(part, dpi=110, format="png", metadata={"Software": "navfw"})


def _draw_passages(axes: Axes, topo_map: TopoMap, avoid: Sequence[Sequence[str]]) -> None:
    from matplotlib.patches import Polygon

    crossed = {frozenset(ends) for ends in avoid}
    for passage in topo_map.passages:
        a, b = topo_map.places[passage.a], topo_map.places[passage.b]
        xs, ys = [a.x, b.x], [a.y, b.y]
        dangerous = passage.danger > 0.5
        color = _DANGER if dangerous else _PASSAGE
        span = math.hypot(b.x - a.x, b.y - a.y)
        if span > 0.0:
            half = 0.5 * min(passage.width, _MAX_WIDTH) / span
            dx, dy = half * (a.y - b.y), half * (b.x - a.x)
            band = [(a.x + dx, a.y + dy), (b.x + dx, b.y + dy)]
            band += [(b.x - dx, b.y - dy), (a.x - dx, a.y - dy)]
            axes.add_patch(Polygon(band, closed=True, fc=color, ec="none", alpha=0.13, zorder=3))
        label = "dangerous passage" if dangerous else "passage"
        axes.plot(xs, ys, color=color, lw=1.0, zorder=4, label=label)
        if passage.ends in crossed:
            style = {"marker": "x", "ms": 10, "mew": 2.4, "color": _DANGER, "ls": "", "zorder": 8}
            axes.plot(0.5 * sum(xs), 0.5 * sum(ys), label="closed", **style)  # type: ignore[arg-type]


def _title(topo_map: TopoMap, route: MarkedRoute | None) -> str:
    if route is not None:
        return f"{topo_map.name}: {route.start} to {route.goal}, {route.length:.1f} m"
    return f"{topo_map.name}: {len(topo_map.places)} places, {len(topo_map.passages)} passages"


def _draw_route(axes: Axes, topo_map: TopoMap, route: MarkedRoute) -> Array:
    """Draw the route with arrow heads in its direction; returns its points (n, 2) [m]."""
    places = [topo_map.places[name] for name in route.places]
    points = np.array([(p.x, p.y) for p in (route.start, *places, route.goal)])
    xs, ys = points.T
    axes.plot(xs, ys, color=GOAL, lw=3.0, alpha=0.8, zorder=5, label="route")
    axes.plot(xs[:1], ys[:1], marker="o", ms=9, color=START, ls="", zorder=7, label="start")
    axes.plot(xs[-1:], ys[-1:], marker="*", ms=14, color=GOAL, ls="", zorder=7, label="goal")
    legs = np.diff(points, axis=0)
    along = np.concatenate([[0.0], np.hypot(*legs.T).cumsum()])
    for distance in np.linspace(0.0, along[-1], _ARROWS + 2)[1:-1]:
        leg = legs[np.searchsorted(along, distance) - 1]
        point = (float(np.interp(distance, along, xs)), float(np.interp(distance, along, ys)))
        draw_arrow(axes, point, math.atan2(leg[1], leg[0]), _NAME, zorder=6.5)
    return points


def _draw_places(axes: Axes, topo_map: TopoMap) -> None:
    for kind, color in _KIND_COLORS.items():
        of_kind = [place for place in topo_map.places.values() if place.kind == kind]
        if of_kind:
            xs, ys = [place.x for place in of_kind], [place.y for place in of_kind]
            axes.plot(xs, ys, marker="o", ms=4.5, color=color, ls="", zorder=6, label=kind)


def _draw_landmarks(axes: Axes, topo_map: TopoMap) -> None:
    for mark in topo_map.landmarks.values():
        facing = (mark.x + 0.4 * math.cos(mark.yaw), mark.y + 0.4 * math.sin(mark.yaw))
        axes.plot([mark.x, facing[0]], [mark.y, facing[1]], color=_LANDMARK, lw=1.6, zorder=7)
        axes.plot(
            mark.x, mark.y, marker="s", ms=5.5, color=_LANDMARK, ls="", zorder=7, label="landmark"
        )
