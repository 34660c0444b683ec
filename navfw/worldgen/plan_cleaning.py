"""Cleans a floor plan of the noise of a map, and selects the free ground in which a robot drives.

Maps by SLAM have single wrong pixels, gaps of a pixel in walls, and free ground behind windows: the
ground is what is certainly free and in one piece.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from navfw.assumption import Assumption
from navfw.errors import InputError
from navfw.numerics import Array, Image, Mask
from navfw.robot import RobotModel
from navfw.topomap.map_builder import MARGIN, Point
from navfw.topomap.occupancy_map import FREE, OCCUPIED, UNKNOWN, Cells, OccupancyMap

SPECKLE, GAP = 0.12, 0.15
"""Size [m] of the largest spots that are removed, and width [m] below which openings are closed."""
_MAX_SPECKLE, _MAX_GAP = 1.0, 0.4
"""Largest allowed values of these [m]."""

_ALONG = 0.25  # chosen
"""Smallest share of the image's border in a piece that counts as outside of a drawing's walls."""
_FRAME = 0.85  # chosen
"""Smallest share of the image's width and height that the white within a drawing's frame spans."""
_UNKNOWN_SHARE = 0.05  # chosen
"""Share of unknown ground above which a plan is taken for one of SLAM, not a drawing."""
_ROOM = 4.0  # chosen
"""Smallest area [m^2] of a piece that is chosen instead of a larger one."""

_Labels = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class CleanedPlan:
    """A plan without noise, and the piece of its free ground in which the default robot drives.

    ``plan`` has all ground connected with the piece, ``ground`` lacks the parts behind passages
    that are too narrow for the robot. ``pieces`` are all pieces, the chosen one first, then by
    falling area: area [m^2], and the point (x, y) [m] where it is widest. If the piece was chosen
    among several without ``inside``, ``assumed`` says which one, and ``picture`` (BGR) shows it in
    green, the others in orange, walls in black, and unknown cells in grey.
    """

    plan: OccupancyMap
    ground: OccupancyMap
    pieces: tuple[tuple[float, Point], ...]
    assumed: tuple[Assumption, ...] = ()
    picture: Image | None = None


def cleaned(
    plan: OccupancyMap, speckle: float = SPECKLE, gap: float = GAP, inside: Point | None = None
) -> CleanedPlan:
    """Clean a plan of speckles and gaps; free ground apart from one piece becomes unknown.

    Occupied or unknown spots up to ``speckle`` [m] that free ground surrounds become free. Gaps
    narrower than ``gap`` [m] become unknown. The piece is the one with the point ``inside`` [m], or
    else the largest that is not ``_outside``.

    Raises:
        InputError: nothing is free, the point is not, or a value is out of range.

    """
    from scipy.ndimage import maximum_position

    for key, value, most in (("--speckle", speckle, _MAX_SPECKLE), ("--gap", gap, _MAX_GAP)):
        if not 0.0 <= value <= most:
            raise InputError(f"expected 0 to {most:g} m, got {value:g}", key=key)
    free = _without_speckles(plan.free, speckle / plan.resolution)
    free = _without_gaps(free, gap / plan.resolution)
    if not free.any():
        raise InputError(
            "the plan has no free ground that is wider than its gaps; choose a smaller --gap, or "
            "check the resolution",
            file=plan.file,
        )
    away = cv2.distanceTransform(np.pad(free, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    labels = _pieces(
        free, away.astype(np.float64), (RobotModel().radius + MARGIN) / plan.resolution + 0.5
    )
    areas: Array = np.bincount(labels.ravel()).astype(np.float64) * plan.resolution**2
    order = 1 + np.argsort(-areas[1:], kind="stable")
    outside = _outside(plan, labels, areas, order)
    rooms = [piece for piece in order if piece not in outside] or order
    taken = rooms[0] if inside is None else _piece_at(plan, labels, areas, inside)
    order = np.append(taken, order[order != taken])
    widest = np.array(maximum_position(away, labels, order))
    points = plan.centres(widest[:, 0], widest[:, 1]).tolist()
    _, joined = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    free = joined == joined[labels == taken][0]
    cells: Cells = np.where(free, FREE, np.where(plan.occupied, OCCUPIED, UNKNOWN)).astype(np.int8)
    ground: Cells = np.where(free & (labels != taken) & (labels > 0), UNKNOWN, cells)
    pieces = tuple(zip(areas[order].tolist(), map(tuple, points), strict=True))
    assumed: tuple[Assumption, ...] = ()
    picture = None
    if inside is None:
        assumed = _assumed(pieces, along=_border_share(labels)[taken] >= _ALONG)
    if inside is None and len(order) > 1:
        drawn = np.select([labels == taken, labels > 0, plan.occupied, plan.free], [1, 2, 3, 4])
        grey, black, white = ((level,) * 3 for level in (160, 0, 255))
        colours = np.array([grey, (80, 170, 60), (70, 150, 240), black, white], np.uint8)
        picture = colours[drawn[::-1]]
    made, mapped = (
        OccupancyMap(c, plan.resolution, plan.origin, plan.file) for c in (cells, ground)
    )
    return CleanedPlan(made, mapped, pieces, assumed, picture)


def _assumed(pieces: tuple[tuple[float, Point], ...], *, along: bool) -> tuple[Assumption, ...]:
    """What is said of the first of the pieces; ``along``: it has much of the image's border."""
    assumed: tuple[Assumption, ...] = ()
    if along:
        reason = "no wall parts it from the rest; close the outer doors in the image"
        assumed += (Assumption("ground along the border of the image", "in the world", reason),)
    if len(pieces) > 1:
        taken, other = (f"{area:.1f} m2 around {x:.2f},{y:.2f}" for area, (x, y) in pieces[:2])
        reason = f"it is the largest of {len(pieces)}, before {other}"
        if pieces[0][0] < pieces[1][0]:
            reason = f"{other} are outside of the walls, by the border of the image"
        assumed += (Assumption("piece of the plan", taken, reason, "--inside X,Y"),)
    return assumed


def _outside(
    plan: OccupancyMap, labels: _Labels, areas: Array, order: npt.NDArray[np.intp]
) -> set[int]:
    """The pieces that are no rooms but the white around a drawing; none if nothing is left then.

    Such a piece takes much of the image's border; or it surrounds all rooms and reaches almost to
    the border, as within a frame, in a plan without the unknown ground that maps by SLAM have.
    """
    share = _border_share(labels)
    outside = {int(piece) for piece in order if share[piece] >= _ALONG}
    rooms = [int(p) for p in order if p not in outside and areas[p] >= _ROOM]
    if len(rooms) > 1 and (plan.cells == UNKNOWN).mean() < _UNKNOWN_SHARE:
        mask = (labels == rooms[0]).astype(np.uint8)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        _, _, width, height = cv2.boundingRect(mask)
        filled = cv2.drawContours(mask, contours, -1, 1, cv2.FILLED)
        spans = min(width / labels.shape[1], height / labels.shape[0]) >= _FRAME
        if spans and filled[np.isin(labels, rooms[1:])].all():
            outside.add(rooms.pop(0))
    return outside if rooms else set()


def _border_share(labels: _Labels) -> Array:
    """Share of the cells along the image's border that each piece has."""
    border = np.concatenate((labels[0], labels[-1], labels[1:-1, 0], labels[1:-1, -1]))
    return np.bincount(border, minlength=int(labels.max()) + 1) / border.size


def _pieces(free: Mask, away: Array, need: float) -> _Labels:
    """By cell: the number of the piece, from 1, in which one ``need`` [cells] wide can drive.

    0 where there is none; where it fits nowhere, the pieces are those of the free ground.
    """
    core = away >= need if (away >= need).any() else free
    _, numbers = cv2.connectedComponents(core.astype(np.uint8), connectivity=8)
    grown = numbers.astype(np.float32)
    for _ in range(math.ceil(2.0 * need)):  # into corners, and up to the walls
        larger = cv2.dilate(grown, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
        grown = np.where(free & (grown == 0.0), larger, grown)
    return grown.astype(np.intp)


def _piece_at(plan: OccupancyMap, labels: _Labels, areas: Array, point: Point) -> int:
    """Return the piece with the point; raises InputError if there is none."""
    rows, columns = np.nonzero(labels)
    centres = plan.centres(rows, columns)
    away = np.hypot(centres[:, 0] - point[0], centres[:, 1] - point[1])
    nearest = int(np.argmin(away))
    label = int(labels[rows[nearest], columns[nearest]])
    if away[nearest] > 0.75 * plan.resolution:
        x, y = centres[nearest]
        raise InputError(
            f"expected a point of free ground, ({point[0]:g}, {point[1]:g}) is {away[nearest]:.2f}"
            f" m from it: the nearest is ({x:.2f}, {y:.2f}), in a piece of {areas[label]:.0f} m2",
            file=plan.file,
            key="--inside",
        )
    return label


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
        ring = cv2.dilate((labels[around] == label).astype(np.uint8), np.ones((3, 3), np.uint8))
        touching = ((ring > 0) & kept[around]).astype(np.uint8)
        blunt[label] = cv2.connectedComponents(touching, connectivity=8)[0] - 1 < 2
    return (kept | blunt[labels])[edge:-edge, edge:-edge]
