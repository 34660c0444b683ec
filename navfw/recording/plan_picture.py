"""Draw plans with matplotlib: shapes, arrows, legend, labels beside the path; pictures of maps.

The picture of a map has places and passages over the floor plan of the world, optionally a route.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.config.extras import extra_imports
from navfw.numerics import Array
from navfw.process.atomic import atomic_file
from navfw.recording.palette import (
    FLOOR,
    FREE,
    GOAL,
    OCCUPIED,
    START,
    rgb,
)
from navfw.recording.top_view import Area, Disc, Line, Marks, Point, Shape, Style, WorldOutline
from navfw.signals import GrownGrid
from navfw.topomap import TopoMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

    from navfw.mapping import MapChange
    from navfw.papfis import Route

_MARKERS = {"circle": "o", "diamond": "D", "square": "s", "star": "*", "x": "x", "cross": "X"}
_ARROW_HEAD = np.array([[1.0, 0.0], [-0.8, 0.6], [-0.5, 0.0], [-0.8, -0.6]])
"""Outline of an arrow head that points along x."""
_LEGEND_WIDTH = 1.25
"""Mean width of an entry of the legend [inch]."""
_GAPS = (4.0, 9.0, 16.0)
"""Distances of a label from its point [pt]; the nearest that is free is taken."""
_SIDES = ((1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1))
"""Sides of its point on which a label may stand, to the right (1), above (1); the best first."""
_PATH_MARGIN = 3.0
"""Half the width of a drawn path, and the space beside it [pt]."""
_MARK = 3.5
"""Half the width of a mark [pt]."""
_OBSERVED_OPACITY = 110
"""Opacity (0 to 255) of observed ground, below which the true plan stays visible."""
_STEP = 3.0
"""Distance of the points to which a path is resampled [pixel]."""


def plan_axes(
    size: Point, frame: tuple[float, ...], low: Array, high: Array
) -> tuple[Figure, Axes]:
    """Make a figure of ``size`` [inch] with axes at ``frame``, from ``low`` to ``high`` (2,) [m].

    ``frame`` is left, bottom, width, height as shares of the figure. The axes have a floor-coloured
    background, small grey tick labels, and no border.
    """
    # the object interface with the Agg canvas needs no window system and leaves pyplot's global
    # state to the calling program
    with extra_imports("report"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    axes = figure.add_axes(frame)  # type: ignore[arg-type]
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_facecolor(FLOOR)
    axes.tick_params(labelsize=8, colors="#666666", length=2)
    for spine in axes.spines.values():
        spine.set_visible(False)
    return figure, axes


def draw_grown_grid(axes: Axes, grid: GrownGrid, zorder: float) -> None:
    """Draw free and occupied cells in their colours, and unknown ones transparent."""
    rows, columns = grid.log_odds.shape
    picture = np.zeros((rows, columns, 4), np.uint8)
    for mask, color in ((grid.free, FREE), (grid.occupied, OCCUPIED)):
        picture[mask] = (*rgb(color), _OBSERVED_OPACITY)
    (x, y), cell = grid.origin, grid.cell
    low, high = (x - 0.5 * cell, y - 0.5 * cell), (x + columns * cell, y + rows * cell)
    extent = low[0], high[0] - 0.5 * cell, low[1], high[1] - 0.5 * cell
    limits = axes.axis()
    axes.imshow(picture, origin="lower", extent=extent, zorder=zorder, interpolation="nearest")
    axes.axis(limits)


def draw_shapes(axes: Axes, shapes: Iterable[Shape], zorder: float) -> None:
    """Draw ``shapes`` above everything of a lower ``zorder``, each over the one before."""
    from matplotlib.patches import Circle, Polygon

    for number, shape in enumerate(shapes):
        style = shape.style
        look: dict[str, Any] = {"zorder": zorder + 1e-4 * number, "alpha": style.opacity}
        if isinstance(shape, Area | Disc):
            look |= {"fc": style.color or "none", "ec": style.edge or "none", "lw": style.width}
            axes.add_patch(
                Polygon(shape.corners, closed=True, **look)
                if isinstance(shape, Area)
                else Circle((shape.x, shape.y), shape.radius, **look)
            )
        elif isinstance(shape, Line):
            look |= {"color": style.color, "lw": style.width, "solid_capstyle": "round"}
            look |= {"ls": (0, (4, 2))} if style.dashed else {}
            axes.plot(*shape.points.T, label=style.label, **look)
        elif len(shape.points):
            look |= {"mfc": style.color or "none", "mec": style.edge or style.color}
            look |= {"marker": _MARKERS[style.marker], "ms": style.size, "mew": style.width}
            axes.plot(*shape.points.T, ls="", label=style.label, **look)


def draw_arrow(axes: Axes, point: Point, yaw: float, color: str, zorder: float) -> None:
    """Draw an arrow head at ``point`` [m] that points along ``yaw`` [rad, map frame]."""
    c, s = math.cos(yaw), math.sin(yaw)
    head = _ARROW_HEAD @ np.array([[c, s], [-s, c]])
    axes.plot(*point, marker=head, ms=9, mfc=color, mec="white", mew=0.8, ls="", zorder=zorder)


def write_legend(figure: Figure, axes: Axes) -> None:
    """Write the legend below the axes, each label once, in as many rows as it needs."""
    entries = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    in_a_row = max(1, int(figure.get_figwidth() / _LEGEND_WIDTH))
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="lower center",
        ncols=math.ceil(len(entries) / math.ceil(len(entries) / in_a_row)),
        columnspacing=1.4,
        fontsize=8,
        frameon=False,
    )


class PathLabels:
    """Writes labels into ``axes``, whose limits are set, so that none covers ``path`` (n, 2) [m].

    Labels written first take their place first; they may stand beside narrow axes.
    """

    def __init__(self, axes: Axes, path: Array, zorder: float) -> None:
        axes.apply_aspect()  # which fixes where points are in the picture
        self._axes = axes
        self._zorder = zorder
        self._renderer = axes.figure.canvas.get_renderer()  # type: ignore[attr-defined]
        self._pixels_per_pt = axes.figure.dpi / 72.0
        self._path = np.empty((0, 2))
        if len(path):  # by points at most ``_STEP`` apart
            points = axes.transData.transform(path)
            along = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
            steps = np.linspace(0.0, along[-1], int(along[-1] / _STEP) + 2)
            self._path = np.column_stack([np.interp(steps, along, axis) for axis in points.T])
        self._taken: list[Bbox] = []

    def keep_clear(self, point: Point) -> None:
        """Keep later labels off the mark at ``point`` [m]."""
        from matplotlib.transforms import Bbox

        at = np.asarray(self._axes.transData.transform(point))
        half = _MARK * self._pixels_per_pt
        self._taken.append(Bbox([at - half, at + half]))

    def write(self, text: str, point: Point, color: str) -> bool:
        """Write ``text`` beside ``point`` [m]; return False, and write nothing, without room."""
        from matplotlib.patheffects import withStroke
        from matplotlib.transforms import Bbox

        label = self._axes.annotate(
            text,
            point,
            xytext=(0.0, 0.0),
            textcoords="offset points",
            ha="left",
            va="bottom",
            fontsize=7,
            color=color,
            path_effects=[withStroke(linewidth=2.0, foreground=FLOOR)],
            zorder=self._zorder,
        )
        at = np.asarray(self._axes.transData.transform(point))
        size = label.get_window_extent(self._renderer).size
        for gap, sides in itertools.product(_GAPS, _SIDES):
            direction = np.array(sides)
            # the lower left corner from the point: beyond the gap, or centred
            corner = 0.5 * (direction - 1) * size + direction * gap * self._pixels_per_pt
            box = Bbox([at + corner, at + corner + size])
            if self._is_free(box):
                label.xyann = tuple(corner / self._pixels_per_pt)
                self._taken.append(box)
                return True
        label.remove()
        return False

    def _is_free(self, box: Bbox) -> bool:
        frame, width = self._axes.bbox, self._axes.figure.bbox.width
        inside = box.x0 >= 0.0 and box.x1 <= width and frame.y0 <= box.y0 and box.y1 <= frame.y1
        if not inside or any(box.overlaps(other) for other in self._taken):
            return False
        margin = _PATH_MARGIN * self._pixels_per_pt
        low, high = np.array(box.min) - margin, np.array(box.max) + margin
        return not ((self._path > low) & (self._path < high)).all(axis=1).any()


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
_CHANGES = {
    "closed": _CLOSED,
    "moved": Style(edge="#B07000", width=2.4, marker="diamond", size=10.0, label="moved"),
    "new": Style(edge="#008040", width=2.4, marker="circle", size=11.0, label="new"),
    "gone": Style(edge="#606060", width=2.0, marker="square", size=10.0, label="gone"),
}
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
    changes: Sequence[MapChange] = (),
) -> None:
    """Write the picture of a map to ``path`` as PNG; passages are to scale, up to a width of 2 m.

    With a ``route`` only its places are named. ``avoid`` has the two ends of each passage that is
    crossed out. With ``changes`` only these are named.
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
    for kind, style in _CHANGES.items():
        at = np.array([(c.x, c.y) for c in changes if c.kind == kind]).reshape(-1, 2)
        draw_shapes(axes, [Marks(at, style)] if len(at) else [], zorder=8.0)
    labels = PathLabels(axes, way, zorder=9)
    for change in changes:
        labels.write(change.what, (change.x, change.y), _NAME)
    named = sorted(topo_map.places, key=len) if route is None else route.places
    for name in () if changes else named:
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
