"""Elementary situations in front: Table 1, and the decision between its alternatives.

Paper sec 5.2 c; METHOD R10-R13. Table 1 gives degrees of alternatives such as "door or corridor"
from the slopes of the two planes. Features of the middle of the image then decide between door,
corridor and corner where possible. Both are inferred from the cells that show objects, their
nearness corrected by the fitted walls and blind borders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer, load_system
from navfw.offis.grid_geometry import MINIMUM_CONFIDENCE, BlindBorders, GridGeometry
from navfw.offis.nearness import MINIMUM_BASELINE, Nearness
from navfw.offis.percept_kernels import object_cells, object_nearness
from navfw.offis.pyramid import Channels
from navfw.offis.walls import Slopes, Walls
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
    geometry: GridGeometry, seen: Nearness, label: npt.NDArray[np.int8]
) -> ObjectCells:
    """Weight the cells of ``seen`` as objects by their ``label`` (rows, cols)."""
    cells = object_cells(
        *seen.flat,
        label.reshape(-1),
        geometry.upward,
        geometry.wall_top,
        geometry.wall_share,
        MINIMUM_CONFIDENCE,
    )
    return ObjectCells(cells[0], cells[1], cells[2])


def object_channels(
    geometry: GridGeometry,
    seen: Nearness,
    objects: ObjectCells,
    walls: Walls,
    borders: BlindBorders,
) -> Channels:
    """Compute the channels of mode ``nearness``: nearness of the objects, with three weights.

    Weights times |x| for muU and |y| for muV make these means of |u| and |v| from which the growth
    of flow with the distance from the focus of expansion is removed (TRAP 1).
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
        MINIMUM_CONFIDENCE,
    )
    shape = seen.nearness.shape
    return Channels(values.reshape(3, *shape), weights.reshape(3, *shape), known.reshape(shape))


def raw_channels(flow: FlowField, focal: float) -> Channels:
    """Compute the channels of mode ``paper`` from all valid vectors: |d|/|e|, |u| and |v|."""
    shift = flow.motion.translation
    foe_vector = flow.points * shift[2] - focal * shift[:2]
    expected = np.hypot(foe_vector[..., 0], foe_vector[..., 1])
    valid = (flow.confidence > 0.0) & np.isfinite(flow.vectors).all(-1)
    valid &= flow.motion.baseline >= MINIMUM_BASELINE
    length = np.where(valid[..., None], np.abs(flow.vectors), 0.0)
    nearness = np.hypot(length[..., 0], length[..., 1]) / np.maximum(expected, 1e-9)
    known = valid.astype(np.float64)
    values = np.stack([nearness, length[..., 0], length[..., 1]])
    return Channels(values, np.stack([known * expected, known, known]), known)


TABLE = (
    "door or corridor",
    "door or corner",
    "door or unknown",
    "corner",
    "left slope wall or unknown",
    "wall",
    "left wall or unknown",
    "right slope wall or unknown",
    "right wall or unknown",
    "unknown",
)
"""The distinct entries of the paper's Table 1."""

FLOOR_IN_FRONT = 0.5  # chosen
"""Least degree of floor in front for the report to contain "Floor in front"."""

ELEMENTARY = (
    "door",
    "corridor",
    "corner",
    "wall",
    "left wall",
    "right wall",
    "left slope wall",
    "right slope wall",
    "unknown",
)
"""The elementary situations."""


@dataclass(frozen=True, slots=True)
class Situations:
    """Degrees in [0, 1] of all situations.

    ``table`` has those of Table 1's entries, ``degrees`` these and all elementary situations;
    ``floor_in_front`` that of free floor ahead; ``front`` is the entry that the report names.
    """

    table: dict[str, float]
    degrees: dict[str, float]
    floor_in_front: float
    front: str
    table_evaluation: FuzzyEvaluation
    front_evaluation: FuzzyEvaluation


def find_situations(
    geometry: GridGeometry, slopes: Slopes, walls: Walls, objects: ObjectCells
) -> Situations:
    """Infer the degrees of all situations from the slopes and the area in front.

    Inputs of the rule base ``front`` besides entries of the table: ``opening`` in [-1, 1], the
    relative distance of the middle of the image behind the planes, or of both borders before them,
    whichever is larger; ``steepness`` [rad], the incline of the less steep plane; ``fit``, the
    share of the object cells that lie in the planes, in the worse half (all from ``walls``);
    ``floor``, the share of the cells of the robot's path that show floor.
    """
    path = geometry.path_cells
    floor = float(product(geometry.path, objects.floor)) / path if path > 0.0 else 0.0
    ahead = min(float(product(geometry.middle, objects.wall_weight)) / 2.0, 1.0)
    support = float(slopes.support.min())
    left, right = slopes.value.tolist()
    in_table = infer(load_system("situation"), {"left": left, "right": right})
    concluded = in_table.result.first("situation")
    table = {name: support * concluded[name.replace(" ", "_")] for name in TABLE}
    table["unknown"] = max(table["unknown"], 1.0 - support)

    in_front = infer(
        load_system("front"),
        {
            "corridor_like": max(table["door or corridor"], table["door or unknown"]),
            "corner_like": max(table["door or corner"], table["corner"]),
            "opening": walls.gap,
            "steepness": float(walls.incline.min()),
            "fit": float(walls.explained.min()),
            "floor": floor,
        },
    )
    front = in_front.result.first("front")
    sure = min(support, ahead)
    degrees = dict(table)
    degrees["door"] = sure * front["door"]
    degrees["corridor"] = min(sure * front["corridor"], table["door or corridor"])
    degrees["corner"] = max(
        min(sure * front["corner"], table["door or corner"]),
        table["corner"] * (1.0 - degrees["door"]),
    )
    for name in ("left wall", "right wall", "left slope wall", "right slope wall"):
        degrees[name] = table[f"{name} or unknown"]
    floor_in_front = in_front.result.first("floor_in_front")["present"]
    entry = _entry(table, degrees)
    return Situations(table, degrees, floor_in_front, entry, in_table, in_front)


def _entry(table: dict[str, float], degrees: dict[str, float]) -> str:
    """The entry in the report: Table 1's strongest, or "door" if its degree is at least 0.5."""
    entry = max(table, key=table.__getitem__)
    if ("door" in entry or entry == "corner") and degrees["door"] >= 0.5:
        return "door"
    return entry
