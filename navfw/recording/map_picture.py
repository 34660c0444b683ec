"""The picture of a map: places and passages over the world's floor plan, optionally a route."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfw.numerics import Array
from navfw.process.atomic import atomic_file
from navfw.recording.palette import GOAL, START
from navfw.recording.plan_picture import (
    PathLabels,
    draw_arrow,
    draw_shapes,
    plan_axes,
    write_legend,
)
from navfw.recording.top_view import Area, Line, Marks, Shape, Style, WorldOutline
from navfw.topomap import TopoMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from navfw.papfis import Route

_KIND_COLORS = {
    "room": "#0072B2",
    "door": "#E69F00",
    "corridor": "#56B4E9",
    "junction": "#009E73",
    "corner": "#8C8577",
    "danger": "#D00000",
}
_DANGER, _LANDMARK, _NAME = "#D00000", "#CC79A7", "#3A3A3A"
_PASSAGE = Style("#7FA7C9", label="passage")
_DANGEROUS = Style(_DANGER, label="dangerous passage")
_BAND_OPACITY = 0.13
_CLOSED = Style(edge=_DANGER, width=2.4, marker="x", size=10.0, label="closed")
_ROUTE = Style(GOAL, width=3.0, opacity=0.8, label="route")
_START = Style(START, size=9.0, label="start")
_GOAL = Style(GOAL, marker="star", size=14.0, label="goal")
_ARROWS = 6
"""Number of arrow heads along a route."""
_MAX_WIDTH = 2.0
"""Largest drawn width of a passage [m]."""


def draw_map(
    path: Path,
    topo_map: TopoMap,
    outline: WorldOutline | None = None,
    route: Route | None = None,
    avoid: Sequence[Sequence[str]] = (),
) -> None:
    """Write the picture as PNG; passages are drawn to scale, up to a width of 2 m.

    With a ``route`` its places alone are named. ``avoid`` has the two ends of each passage that is
    crossed out.
    """
    points = np.array([(place.x, place.y) for place in topo_map.places.values()])
    world = WorldOutline() if outline is None else outline
    low, high = world.bounds(0.5, points)
    scale = min(16.0 / (high[0] - low[0]), 11.0 / (high[1] - low[1]))
    wide = max((high[0] - low[0]) * scale, 7.0)
    inches = max((high[1] - low[1]) * scale, 3.0) + 0.9
    frame = (0.04, 0.7 / inches, 0.94, 1.0 - 1.05 / inches)
    figure, axes = plan_axes((wide, inches), frame, low, high)
    draw_shapes(axes, [*world.shapes(), *_passages(topo_map, avoid)], zorder=1.0)
    draw_shapes(axes, [*_places(topo_map), *_landmarks(topo_map)], zorder=6.0)
    way = np.empty((0, 2))
    if route is not None:
        stops = [(topo_map.places[name].x, topo_map.places[name].y) for name in route.places]
        ends = [(end.x, end.y) for end in (route.start, route.goal)]
        way = np.array([ends[0], *stops, ends[1]])
    if route is not None:
        draw_shapes(axes, [Line(way, _ROUTE)], zorder=5.0)
        draw_shapes(axes, [Marks(way[:1], _START), Marks(way[-1:], _GOAL)], zorder=7.0)
        _draw_arrows(axes, way)
    labels = PathLabels(axes, way, zorder=9)
    for name in sorted(topo_map.places, key=len) if route is None else route.places:
        labels.write(name, (topo_map.places[name].x, topo_map.places[name].y), _NAME)
    about = f"{len(topo_map.places)} places, {len(topo_map.passages)} passages"
    if route is not None:
        about = f"{route.start} to {route.goal}, {route.length:.1f} m"
    axes.set_title(f"{topo_map.name}: {about}", fontsize=11, loc="left")
    write_legend(figure, axes)
    with atomic_file(path, parents=True) as unfinished:
        figure.savefig(unfinished, dpi=110, format="png", metadata={"Software": "navfw"})


def _passages(topo_map: TopoMap, avoid: Sequence[Sequence[str]]) -> Iterator[Shape]:
    crossed = {frozenset(ends) for ends in avoid}
    for passage in topo_map.passages:
        a, b = topo_map.places[passage.a], topo_map.places[passage.b]
        ends = np.array([(a.x, a.y), (b.x, b.y)])
        style = _DANGEROUS if passage.danger > 0.5 else _PASSAGE
        span = math.hypot(b.x - a.x, b.y - a.y)
        if span > 0.0:
            half = 0.5 * min(passage.width, _MAX_WIDTH) / span
            aside = half * np.array([a.y - b.y, b.x - a.x])
            band = np.vstack([ends + aside, ends[::-1] - aside])
            yield Area(band, replace(style, opacity=_BAND_OPACITY))
        yield Line(ends, style)
        if passage.ends in crossed:
            yield Marks(ends.mean(axis=0)[None], _CLOSED)


def _draw_arrows(axes: Axes, way: Array) -> None:
    legs = np.diff(way, axis=0)
    along = np.concatenate([[0.0], np.hypot(*legs.T).cumsum()])
    for distance in np.linspace(0.0, along[-1], _ARROWS + 2)[1:-1]:
        leg = legs[np.searchsorted(along, distance) - 1]
        x, y = (float(np.interp(distance, along, way[:, axis])) for axis in (0, 1))
        draw_arrow(axes, (x, y), math.atan2(leg[1], leg[0]), _NAME, zorder=6.5)


def _places(topo_map: TopoMap) -> Iterator[Shape]:
    for kind, color in _KIND_COLORS.items():
        points = [(p.x, p.y) for p in topo_map.places.values() if p.kind == kind]
        yield Marks(np.array(points).reshape(-1, 2), Style(color, size=4.5, label=kind))


def _landmarks(topo_map: TopoMap) -> Iterator[Shape]:
    for mark in topo_map.landmarks.values():
        ahead = 0.4 * np.array([math.cos(mark.yaw), math.sin(mark.yaw)])
        at = np.array([mark.x, mark.y])
        yield Line(np.array([at, at + ahead]), Style(_LANDMARK, width=1.6))
        yield Marks(at[None], Style(_LANDMARK, marker="square", size=5.5, label="landmark"))
