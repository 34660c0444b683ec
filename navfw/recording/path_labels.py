"""Labels in top-view pictures that cover neither each other nor the path."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from navfw.recording.palette import FLOOR
from navfw.recording.top_view import Point
from navfw.signals import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.transforms import Bbox

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
        self._path = _dense(axes.transData.transform(path)) if len(path) else np.empty((0, 2))
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


def _dense(points: Array) -> Array:
    """Points (m, 2) at most ``_STEP`` apart on the lines through ``points`` (n, 2)."""
    along = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
    steps = np.linspace(0.0, along[-1], int(along[-1] / _STEP) + 2)
    return np.column_stack([np.interp(steps, along, points[:, axis]) for axis in (0, 1)])
