"""Common parts of top-view pictures: outline of the world, plain axes, arrows along a path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfw.recording.palette import EDGE, FLOOR, FURNITURE, WALL
from navfw.signals import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Point = tuple[float, float]

_ARROW_HEAD = np.array([[1.0, 0.0], [-0.8, 0.6], [-0.5, 0.0], [-0.8, -0.6]])
"""Outline of an arrow head that points along x."""
_LEGEND_WIDTH = 1.25
"""Mean width of an entry of the legend [inch]."""


@dataclass(frozen=True, slots=True)
class OutlineDisc:
    """A round object in top view: centre x, y [m, map frame] and radius [m]."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class WorldOutline:
    """A world in top view; polygons are (k, 2) [m] in ``map``."""

    walls: Sequence[Array] = ()
    furniture: Sequence[Array] = ()
    discs: Sequence[OutlineDisc] = ()


def style_axes(axes: Axes) -> None:
    """Set a floor-coloured background, small grey tick labels, and no frame."""
    axes.set_facecolor(FLOOR)
    axes.tick_params(labelsize=8, colors="#666666", length=2)
    for spine in axes.spines.values():
        spine.set_visible(False)


def draw_outline(axes: Axes, outline: WorldOutline, edge: float, wall_edge: float) -> None:
    """Draw furniture and walls below everything else; ``edge``, ``wall_edge``: line widths."""
    from matplotlib.patches import Circle, Polygon

    for polygon in outline.furniture:
        axes.add_patch(Polygon(polygon, closed=True, fc=FURNITURE, ec=EDGE, lw=edge, zorder=1))
    for disc in outline.discs:
        circle = Circle((disc.x, disc.y), disc.radius, fc=FURNITURE, ec=EDGE, lw=edge, zorder=1)
        axes.add_patch(circle)
    for polygon in outline.walls:
        axes.add_patch(Polygon(polygon, closed=True, fc=WALL, ec=WALL, lw=wall_edge, zorder=2))


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
