"""Common parts of top-view pictures: outline of the world, plain axes, names of places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from navfw.signals import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.transforms import Bbox

__all__ = ["OutlineDisc", "Point", "WorldOutline", "draw_names", "draw_outline", "style_axes"]

Point = tuple[float, float]

_WALL, _FURNITURE, _EDGE, _FLOOR = "#4A4A4A", "#D9D2C5", "#8C8577", "#FBFAF7"


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
    axes.set_facecolor(_FLOOR)
    axes.tick_params(labelsize=8, colors="#666666", length=2)
    for spine in axes.spines.values():
        spine.set_visible(False)


def draw_outline(axes: Axes, outline: WorldOutline, edge: float, wall_edge: float) -> None:
    """Draw furniture and walls below everything else; ``edge``, ``wall_edge``: line widths."""
    from matplotlib.patches import Circle, Polygon

    for polygon in outline.furniture:
        axes.add_patch(Polygon(polygon, closed=True, fc=_FURNITURE, ec=_EDGE, lw=edge, zorder=1))
    for disc in outline.discs:
        circle = Circle((disc.x, disc.y), disc.radius, fc=_FURNITURE, ec=_EDGE, lw=edge, zorder=1)
        axes.add_patch(circle)
    for polygon in outline.walls:
        axes.add_patch(Polygon(polygon, closed=True, fc=_WALL, ec=_WALL, lw=wall_edge, zorder=2))


def draw_names(axes: Axes, places: Mapping[str, Point], color: str, zorder: int) -> None:
    """Write names beside ``places``, in their order; names that would overlap others are left out.

    The limits of ``axes`` have to be set before.
    """
    from matplotlib.patheffects import withStroke

    renderer = axes.figure.canvas.get_renderer()  # type: ignore[attr-defined]
    taken: list[Bbox] = []
    for name, point in places.items():
        text = axes.annotate(
            name,
            point,
            xytext=(4, 4),
            textcoords="offset points",
            fontsize=7,
            color=color,
            path_effects=[withStroke(linewidth=2.0, foreground=_FLOOR)],
            zorder=zorder,
        )
        box = text.get_window_extent(renderer)
        if any(box.overlaps(other) for other in taken):
            text.remove()
        else:
            taken.append(box)
