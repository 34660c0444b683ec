"""Plans drawn with matplotlib: shapes, arrows, legend, and labels clear of the path."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.config.extras import extra_imports
from navfw.numerics import Array
from navfw.recording.palette import FLOOR
from navfw.recording.top_view import Area, Disc, Line, Point, Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

_MARKERS = {"circle": "o", "diamond": "D", "square": "s", "star": "*", "x": "x", "cross": "X"}
_ARROW_HEAD = np.array([[1.0, 0.0], [-0.8, 0.6], [-0.5, 0.0], [-0.8, -0.6]])
"""Outline of an arrow head that points along x."""
_LEGEND_WIDTH = 1.25
"""Mean width of an entry of the legend [inch]."""
_GAPS = (4.0, 9.0, 16.0)
"""Distances of a label from its point [pt]; the nearest free place is taken."""
_SIDES = ((1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1))
"""Where a label lies from its point, to the right (1) and above (1); the best first."""
_PATH_MARGIN = 3.0
"""Half the width of a drawn path, and the space beside it [pt]."""
_MARK = 3.5
"""Half the width of a mark [pt]."""
_STEP = 3.0
"""Distance of the points by which the path is known [pixel]."""


def plan_axes(
    size: Point, frame: tuple[float, ...], low: Array, high: Array
) -> tuple[Figure, Axes]:
    """A figure of ``size`` [inch] with axes at ``frame`` in it, from ``low`` to ``high`` (2,) [m].

    The axes have a floor-coloured background, small grey tick labels, and no border.
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


def draw_shapes(axes: Axes, shapes: Iterable[Shape], zorder: float) -> None:
    """Draw ``shapes`` over what has a lower ``zorder``, each over the one before."""
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
    """Draw an arrow head at ``point`` that points along ``yaw`` [rad]."""
    c, s = math.cos(yaw), math.sin(yaw)
    head = _ARROW_HEAD @ np.array([[c, s], [-s, c]])
    axes.plot(*point, marker=head, ms=9, mfc=color, mec="white", mew=0.8, ls="", zorder=zorder)


def write_legend(figure: Figure, axes: Axes) -> None:
    """Write the legend below, each label once, in as many rows as it needs."""
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
    """Writes labels into ``axes``, whose limits are set, clear of a ``path`` (n, 2) [m].

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
        """Let no label cover the mark at ``point`` [m]."""
        from matplotlib.transforms import Bbox

        at = np.asarray(self._axes.transData.transform(point))
        half = _MARK * self._pixels_per_pt
        self._taken.append(Bbox([at - half, at + half]))

    def write(self, text: str, point: Point, color: str) -> bool:
        """Write ``text`` beside ``point`` [m]; False, and nothing, where there is no room."""
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
