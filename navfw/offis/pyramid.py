"""The pyramid of image regions and their statistics (paper sec 4.2, 4.3; METHOD R4-R6, R14, R15).

Layer 1 splits the grid into the quadrants P1..P4, numbered as in mathematics: P1 upper right, P2
upper left, P3 lower left, P4 lower right. Each deeper layer splits every region likewise: sP41 is
the upper right part of P4, sP413 the lower left part of that. A side of odd length is split into
two halves that share the middle row or column, as the paper's 10 x 15 -> 5 x 8 -> 3 x 4 does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.offis.percept_kernels import region_moments

QUADRANTS = ("P1", "P2", "P3", "P4")
"""P1 upper right, P2 upper left, P3 lower left, P4 lower right (METHOD R4)."""

NEIGHBOURS = ((0, 1), (1, 2), (2, 3), (3, 0))  # defined
"""Pairs of the four sibling regions that share a side, by index."""

Rectangle = tuple[int, int, int, int]
"""Row, end row, column, end column of cells."""

_POSITIONS = ("upper right", "upper left", "lower left", "lower right")


def position(region: str) -> str:
    """Name the position of the quadrant of ``region`` (``P2`` or ``sP2...``): "upper left"."""
    return _POSITIONS[int(region.removeprefix("s")[1]) - 1]


@dataclass(frozen=True, slots=True)
class Channels:
    """The quantities that are averaged over regions, with their weights.

    ``values`` and ``weights`` (3, rows, cols) are those of nearness [1/m] and of the quantities
    averaged to muU and muV; a weight of 0 leaves a cell out. ``known`` (rows, cols) is 1 for known
    cells, otherwise 0.
    """

    values: Array
    weights: Array
    known: Array


@dataclass(frozen=True, slots=True)
class RegionStatistics:
    """Statistics of all regions, arrays (n_regions,), in the order of ``Pyramid.names``.

    ``known`` is the share of known cells, ``objects`` the share of cells that show an object.
    ``mean`` [1/m] and ``variance`` [1/m^2] are those of nearness; ``mu_u``, ``var_u``, ``mu_v`` and
    ``var_v`` are those of METHOD R6. ``nearest`` [1/m] is the mean nearness of the nearest eighth
    of the object cells.
    """

    known: Array
    objects: Array
    mean: Array
    variance: Array
    mu_u: Array
    var_u: Array
    mu_v: Array
    var_v: Array
    nearest: Array


class Pyramid:
    """Regions of a (rows, cols) grid in ``layers`` layers, and the halves of the two planes.

    ``names`` lists the regions layer by layer, siblings in the order P1..P4. The last four are
    ``left outer``, ``left inner``, ``right inner`` and ``right outer``: the halves of the left
    plane (P2 + P3) and of the right plane (P1 + P4) at the border and at the middle of the image.
    ``families`` are the indices of the first of each four siblings. Too small a grid: ValueError.
    """

    def __init__(self, shape: tuple[int, int], layers: int) -> None:
        rows, cols = shape
        if min(rows, cols) < 2**layers:
            raise ValueError(f"a {rows} x {cols} grid cannot be split into {layers} layers")
        self.shape = shape
        self.layers = layers
        self.names: list[str] = []
        rectangles: list[Rectangle] = []
        parents = [("", (0, rows, 0, cols))]
        for layer in range(layers):
            children: list[tuple[str, Rectangle]] = []
            for parent, rectangle in parents:
                prefix = "P" if layer == 0 else parent if layer > 1 else f"s{parent}"
                children += [(f"{prefix}{i + 1}", q) for i, q in enumerate(_split(rectangle))]
            self.names += [name for name, _ in children]
            rectangles += [rectangle for _, rectangle in children]
            parents = children
        left, right = (0, rows, 0, (cols + 1) // 2), (0, rows, cols // 2, cols)
        self.names += ["left outer", "left inner", "right inner", "right outer"]
        rectangles += [*_columns(left), *_columns(right)]
        self.rectangles: npt.NDArray[np.int64] = np.array(rectangles, dtype=np.int64)
        self.families = range(0, len(self.names) - 4, 4)

    def first_child(self, region: int) -> int | None:
        """Return the index of the first of the four parts of ``region``; None in the last layer."""
        first = 4 + 4 * region
        return first if first < len(self.names) - 4 else None

    def statistics(self, channels: Channels) -> RegionStatistics:
        """Compute the statistics of every region (METHOD R6)."""
        moments = region_moments(self.rectangles, channels.values, channels.weights, channels.known)
        return RegionStatistics(*moments.T)


def _split(rectangle: Rectangle) -> list[Rectangle]:
    """The four parts (upper right, upper left, lower left, lower right), each of ceil-half size."""
    row, end_row, col, end_col = rectangle
    height, width = (end_row - row + 1) // 2, (end_col - col + 1) // 2
    upper, lower = (row, row + height), (end_row - height, end_row)
    left, right = (col, col + width), (end_col - width, end_col)
    return [(*upper, *right), (*upper, *left), (*lower, *left), (*lower, *right)]


def _columns(rectangle: Rectangle) -> list[Rectangle]:
    """The left and the right half of a rectangle, sharing the middle column of an odd width."""
    row, end_row, col, end_col = rectangle
    width = (end_col - col + 1) // 2
    return [(row, end_row, col, col + width), (row, end_row, end_col - width, end_col)]
