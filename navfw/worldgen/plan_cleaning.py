"""The ground of a floor plan that is certainly free and in one piece, without the noise of a map.

Maps by SLAM have single wrong pixels, gaps of a pixel in walls, and free ground behind windows.
"""

from __future__ import annotations

from typing import Annotated

import cv2
import numpy as np
from pydantic import Field

from navfw.config.strict_model import StrictModel
from navfw.signals import Mask
from navfw.topomap.occupancy_map import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyMap


class PlanCleaning(StrictModel):
    """The steps of cleaning, in this order; 0 leaves a step out."""

    speckle: Annotated[
        float,
        Field(ge=0.0, le=1.0, description="spots within free ground up to this size vanish [m]"),
    ] = 0.12
    gap: Annotated[
        float,
        Field(ge=0.0, le=0.4, description="openings narrower than this are closed [m]"),
    ] = 0.15


def cleaned(plan: OccupancyMap, cleaning: PlanCleaning) -> OccupancyMap:
    """The plan without speckles and gaps; free ground apart from the largest piece is unknown.

    Small occupied or unknown spots that free ground surrounds become free. Gaps narrower than
    ``cleaning.gap`` become unknown, and with them any ground behind that has no wider entrance.
    """
    free = _without_speckles(plan.free, cleaning.speckle / plan.resolution)
    free = _without_gaps(free, cleaning.gap / plan.resolution)
    free = _largest_piece(free)
    cells: Cells = np.where(free, FREE, np.where(plan.occupied, OCCUPIED, UNKNOWN)).astype(np.int8)
    return OccupancyMap(cells, plan.resolution, plan.origin, plan.file)


def _without_speckles(free: Mask, size: float) -> Mask:
    """Free ground with the spots in it that are at most ``size`` cells wide and high."""
    # unknown all around: a spot at the edge of the grid is not surrounded
    blocked = np.pad(~free, 1, constant_values=True).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(blocked, connectivity=8)
    extent = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    small = extent <= size
    small[0] = False  # the label of the free ground
    grown: Mask = free | small[labels[1:-1, 1:-1]]
    return grown


def _without_gaps(free: Mask, width: float) -> Mask:
    """Free ground without its parts narrower than ``width`` cells."""
    edge = round(width)
    if edge < 2:
        return free
    kernel = np.ones((edge, edge), np.uint8)
    padded = np.pad(free, edge).astype(np.uint8)
    eroded = cv2.erode(padded, kernel, anchor=(edge // 2, edge // 2))
    opposite = edge - 1 - edge // 2  # of an even kernel the middle lies beside its centre
    opened = cv2.dilate(eroded, kernel, anchor=(opposite, opposite))
    # a square kernel also blunts the corners of slanted walls: those parts are no gaps, they touch
    # what remains along one side only
    lost = ((padded > 0) & (opened == 0)).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(lost, connectivity=4)
    kept = opened > 0
    blunt = np.zeros(count, dtype=np.bool_)
    for label in range(1, count):
        x, y, w, h = stats[label, :4]
        around = np.s_[y - 1 : y + h + 1, x - 1 : x + w + 1]
        blunt[label] = _stretches(labels[around] == label, kept[around]) < 2
    wide: Mask = (kept | blunt[labels])[edge:-edge, edge:-edge]
    return wide


def _stretches(part: Mask, kept: Mask) -> int:
    """The number of separate stretches along which ``part`` touches the ground that is kept."""
    ring = cv2.dilate(part.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return int(cv2.connectedComponents((ring & kept).astype(np.uint8), connectivity=8)[0]) - 1


def _largest_piece(free: Mask) -> Mask:
    """The largest 4-connected piece of the free ground."""
    count, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    if count <= 1:
        return free
    piece: Mask = labels == 1 + int(np.argmax(np.bincount(labels.ravel(), minlength=count)[1:]))
    return piece
