"""Cells that show objects, and their nearness corrected by the fitted walls and blind borders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.offis.grid_geometry import BlindBorders, GridGeometry
from navfw.offis.nearness import Nearness
from navfw.offis.percept_kernels import object_cells, object_nearness
from navfw.offis.pyramid import Channels
from navfw.offis.walls import Walls
from navfw.signals import FlowField


@dataclass(frozen=True, slots=True)
class ObjectCells:
    """Weights of the cells as objects, flat (n,).

    ``weight`` is the confidence of a cell that shows an object, otherwise 0. Not objects are floor
    and drops (TRAP 2), cells below the horizon that may be either, and points certainly higher than
    walls: a ceiling, or the far side of a room above a partition. Above the horizon there is no
    floor, so all other cells of sufficient confidence count there, overhead points included.
    ``wall_weight`` is the weight in the fits of walls; ``floor`` is 1 for floor, otherwise 0.
    """

    weight: Array
    wall_weight: Array
    floor: Array


def find_objects(
    geometry: GridGeometry, seen: Nearness, label: npt.NDArray[np.int8], minimum_confidence: float
) -> ObjectCells:
    """Weights of the cells of ``seen`` by their ``label`` (rows, cols)."""
    cells = object_cells(
        *seen.flat,
        label.reshape(-1),
        geometry.upward,
        geometry.wall_top,
        geometry.wall_share,
        minimum_confidence,
    )
    return ObjectCells(cells[0], cells[1], cells[2])


def object_channels(
    geometry: GridGeometry,
    seen: Nearness,
    objects: ObjectCells,
    walls: Walls,
    borders: BlindBorders,
    minimum_confidence: float,
) -> Channels:
    """Channels of mode ``nearness``: nearness of the objects, weighted by |x| for muU, |y| for muV.

    The weights make muU and muV means of |u| and |v| from which the growth of flow with the
    distance from the focus of expansion is removed (TRAP 1).
    """
    values, weights, known = object_nearness(
        geometry.lateral_edge,
        geometry.lateral,
        geometry.ahead,
        geometry.fall,
        geometry.halves,
        geometry.off_axis,
        walls.slant,
        walls.front,
        walls.support,
        *seen.flat,
        objects.weight,
        objects.floor,
        geometry.column,
        walls.nearer,
        borders.hidden,
        geometry.mount_height,
        geometry.wall_height,
        minimum_confidence,
    )
    shape = seen.nearness.shape
    return Channels(values.reshape(3, *shape), weights.reshape(3, *shape), known.reshape(shape))


def raw_channels(flow: FlowField, focal: float, minimum_baseline: float) -> Channels:
    """Channels of mode ``paper``: |u| and |v| of all valid vectors, floor included, and |d|/|e|."""
    shift = flow.motion.translation
    foe_vector = flow.points * shift[2] - focal * shift[:2]
    expected = np.hypot(foe_vector[..., 0], foe_vector[..., 1])
    valid = (flow.confidence > 0.0) & np.isfinite(flow.vectors).all(-1)
    valid &= flow.motion.baseline >= minimum_baseline
    length = np.where(valid[..., None], np.abs(flow.vectors), 0.0)
    nearness = np.hypot(length[..., 0], length[..., 1]) / np.maximum(expected, 1e-9)
    known = valid.astype(np.float64)
    values = np.stack([nearness, length[..., 0], length[..., 1]])
    return Channels(values, np.stack([known * expected, known, known]), known)
