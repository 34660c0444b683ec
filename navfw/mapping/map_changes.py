"""Differences between a map and what was seen of the building: doors, openings, furniture.

Each door of the map is a gap in a wall. Along that wall, the observations show where the gap is
now, or that there is none. An opening is a gap along a wall of the floor plan. A thing of the plan
is gone if the robot's body fits where it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import networkx as nx
import numpy as np

from navfw.errors import InputError
from navfw.localmap.cell_arrays import distances, without_gaps
from navfw.numerics import Array, Mask
from navfw.signals import GrownGrid
from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, SCALE, Evidence
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import OccupancyMap

Point = tuple[float, float]
ChangeKind = Literal["closed", "moved", "new", "gone"]

_ALONG, _DEEP, _INNER = 1.6, 0.3, 0.15  # chosen
"""Half the length [m] of wall that is examined beside a door, half its depth, and half the depth
that has to be free in an opening."""
_SEEN = 0.7  # chosen
"""Share of the depth of an opening that has to be seen free, as some rays are missing."""
_GAP = np.ones((1, 3), np.uint8)  # defined
"""Structuring element that closes gaps of a cell along a wall."""
_SURELY_FREE = -24  # measured
"""Evidence from which a wall or thing of the plan is gone: in five drives it was -37 where one was,
and -9 to -22 where rays had passed over it, or beside a wall."""
_OPENING, _EDGE = 0.45, 4  # chosen
"""Smallest width [m] of an opening, and cells beside it that are searched for its edge."""
_EDGES = 0.5, 0.75, 1.0  # chosen
"""Certainty of an opening with none, one and both of its edges."""
_DRIFT = 0.15  # measured
"""Standard deviation [m] of positions on the map: in 11 of 12 drives 95 % of the errors of the
position were below 0.05 to 0.26 m."""
_MIN_CERTAINTY = 0.5  # chosen
"""Smallest certainty of changes that are reported."""
_SHIFT, _OTHER = 0.25, 0.4  # chosen
"""Distance [m] from which on a door has moved; that of an opening from another's door."""
_CLOSED, _NOT_FREE = 0.7, 0.1  # chosen
"""Smallest share of a closed door's width that is seen occupied, and largest share seen free."""
ROOM = 0.15  # chosen
"""Clearance [m] at which a wall or thing of the plan is gone: poses are off by up to 0.1 m."""
_MIN_AREA, _MIN_OPENING_AREA = 0.1, 0.025  # chosen
"""Smallest area [m^2] of the middle of a thing that is gone, and of free wall in an opening."""
_AROUND = 0.45  # chosen
"""Distance [m] around a missing part in which free ground of the plan tells a wall from a thing."""
_SAME = 0.8  # chosen
"""Distance [m] up to which a missing part belongs to a door that has moved."""


@dataclass(frozen=True, slots=True)
class MapChange:
    """A difference at x, y [m, map]: a passage ``closed``, ``moved`` or ``new``, or a thing gone.

    ``what`` is the door or passage of the map, ``detail`` describes the difference, ``time`` [s] is
    when it was seen last, ``certainty`` is in [0, 1]. ``dx``, ``dy`` [m] is the displacement of a
    moved door, or the direction (length 1) through a new opening.
    """

    kind: ChangeKind
    what: str
    x: float
    y: float
    certainty: float
    detail: str = ""
    time: float | None = None
    dx: float = 0.0
    dy: float = 0.0

    def __str__(self) -> str:
        seen = "" if self.time is None else f", seen at {self.time:.0f} s"
        detail = f": {self.detail}" if self.detail else ""
        where = f"({self.x:.1f}, {self.y:.1f})"
        return f"{self.kind} {self.what} at {where}{detail}{seen}, {self.certainty:.0%} certain"


def grid_of(plan: OccupancyMap) -> GrownGrid:
    """Convert a floor plan, with axes along those of ``map``, to a grid of sure evidence."""
    evidence = np.zeros(plan.cells.shape, np.int8)
    evidence[plan.free], evidence[plan.occupied] = -48, 96
    x, y = plan.origin.to_parent(0.5 * plan.resolution, 0.5 * plan.resolution)
    return GrownGrid(evidence, (x, y), plan.resolution)


def changes_between(
    topo_map: TopoMap,
    seen: GrownGrid | TopoMap,
    closed: Sequence[Passage] = (),
    found: Sequence[tuple[str, Sequence[Point]]] = (),
    last_seen: Callable[[float, float], float | None] = lambda x, y: None,
) -> list[MapChange]:
    """Find how the grid ``seen``, or a later map, differs from ``topo_map``, doors first.

    Maps are compared by names, if the later one has most places of the other; else by its plan.
    ``closed`` are passages that the planner has found closed, ``found`` the names and tracks (x, y)
    [m] of new paths that it has found. ``last_seen`` returns the time [s] at which the point x, y
    [m] was last seen.

    Raises:
        InputError: the maps share few places, and the later one has no floor plan.

    """
    if isinstance(seen, TopoMap):
        return _differences(topo_map, seen)
    grid = seen
    doors = [place for place in topo_map.places.values() if place.kind == "door"]
    changes = [change for door in doors if (change := _door_change(topo_map, door, doors, grid))]
    judged = {change.what for change in changes}
    for passage in closed:
        if passage.ends <= topo_map.places.keys() and not judged & passage.ends:
            change = _at_passage("closed", topo_map, passage)
            changes.append(replace(change, certainty=0.5, detail="the robot got no further"))
    if topo_map.floor_plan is not None:
        moved = [change for change in changes if change.kind == "moved"]
        changes += _gone(topo_map.floor_plan, grid, moved)
    for name, track in found:
        for at in _crossings(topo_map.floor_plan, track):
            near = [c for c in changes if c.kind != "closed" and math.dist(at, (c.x, c.y)) <= _SAME]
            openings = [change for change in near if change.kind == "new"]
            changes = [change for change in changes if change not in openings]
            if openings or not near:
                x, y = (openings[0].x, openings[0].y) if openings else at
                changes.append(MapChange("new", name, x, y, 1.0, "driven"))
    sure = [change for change in changes if change.certainty >= _MIN_CERTAINTY]
    return [replace(change, time=last_seen(change.x, change.y)) for change in sure]


def _crossings(plan: OccupancyMap | None, track: Sequence[Point]) -> list[Point]:
    """Return where ``track`` leads through what ``plan`` shows; its middle without a plan."""
    if plan is None:
        return [track[len(track) // 2]]
    drawn = np.zeros(plan.cells.shape, np.uint8)
    cells = plan.cells_at(np.array(track))[:, ::-1].astype(np.int32)
    cv2.polylines(drawn, [cells], isClosed=False, color=1)
    return [_middle(plan, part) for part in _parts((drawn > 0) & plan.occupied, plan, 0.0)]


def _door_change(
    topo_map: TopoMap, door: Place, doors: Sequence[Place], grid: GrownGrid
) -> MapChange | None:
    """Return how a door differs from the map; None if it does not, or too little was seen."""
    normal = topo_map.door_normal(door)
    if normal is None:
        return None
    width = min((p.width for p in topo_map.passages_at(door.name)), default=0.9)
    half = 0.5 * (width if width <= 2.0 * _ALONG else 0.9)
    along = np.arange(-_ALONG - half, _ALONG + half + 1e-9, grid.cell)
    blocked, clear, evidence = _wall(grid, (door.x, door.y), normal, along)
    inner = np.abs(along) <= max(half - 0.1, 0.15)
    tangent = (-normal[1], normal[0])
    openings = _openings(clear, grid.cell)
    sure = _sureness(evidence[inner])
    if openings:
        left, right = min(openings, key=lambda at: abs(along[at[0]] + along[at[1]]))
        offset = 0.5 * float(along[left] + along[right])
        edges = _edges(blocked, left, right)
        by_one = any(edges) and not all(edges) and bool(clear[inner].any())
        if by_one:  # the other edge is a door's width away, as before
            offset = float(along[left] + half if edges[0] else along[right] - half)
        at = door.x + offset * tangent[0], door.y + offset * tangent[1]
        others = [o for o in doors if o is not door and math.dist(at, (o.x, o.y)) <= _OTHER]
        if abs(offset) < _SHIFT or (clear[inner].all() and not all(edges)):
            return None
        if (by_one or all(edges)) and not others:
            detail = f"by {abs(offset):.1f} m, {along[right] - along[left] + grid.cell:.1f} m wide"
            dx, dy = offset * tangent[0], offset * tangent[1]
            certainty = sure * _EDGES[sum(edges)] * _beyond_drift(offset)
            return MapChange("moved", door.name, *at, certainty, detail, None, dx, dy)
    if blocked[inner].mean() >= _CLOSED and clear[inner].mean() <= _NOT_FREE:
        certainty = sure * float(blocked[inner].mean())
        return MapChange("closed", door.name, door.x, door.y, certainty)
    return None


def _wall(grid: GrownGrid, at: Point, normal: Point, along: Array) -> tuple[Mask, Mask, Array]:
    """Look at the wall of a door ``at`` x, y [m], at the distances ``along`` [m] it.

    Returns where it is seen occupied, where free, and the strongest evidence (n,) each.
    """
    deep = np.arange(-_DEEP, _DEEP + 1e-9, grid.cell)
    a, d = np.meshgrid(along, deep, indexing="ij")
    x, y = at[0] - a * normal[1] + d * normal[0], at[1] + a * normal[0] + d * normal[1]
    evidence = grid.evidence_at(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(a.shape)
    blocked = np.asarray((evidence >= OCCUPIED_FROM).any(axis=1))
    clear = (evidence[:, np.abs(deep) <= _INNER] <= FREE_BELOW).mean(axis=1) > _SEEN
    clear = cv2.morphologyEx((clear & ~blocked).astype(np.uint8), cv2.MORPH_CLOSE, _GAP)
    strongest = np.take_along_axis(evidence, np.abs(evidence).argmax(axis=1)[:, None], axis=1)
    return blocked, (clear[0] > 0) & ~blocked, strongest[:, 0].astype(np.float64)


def _runs(flags: Mask) -> list[tuple[int, int]]:
    """Return the first and last index of each run of true ``flags``."""
    edges = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return list(zip(first.tolist(), last.tolist(), strict=True))


def _openings(clear: Mask, cell: float) -> list[tuple[int, int]]:
    """Return the first and last index of each stretch of a wall that is wide enough to be open."""
    return [(a, b) for a, b in _runs(clear) if (b - a + 1) * cell >= _OPENING - 1e-9]


def _edges(blocked: Mask, left: int, right: int) -> tuple[bool, bool]:
    """Return which edges of an opening from ``left`` to ``right`` are seen."""
    before, after = blocked[max(left - _EDGE, 0) : left], blocked[right + 1 : right + 1 + _EDGE]
    return bool(before.any()), bool(after.any())


def _sureness(evidence: Array | Evidence) -> float:
    """Return in [0, 1] how sure cells with this ``evidence`` are: of free ground there is less."""
    certain = np.where(evidence < 0, SCALE, 2.0 * SCALE)
    return float(np.minimum(np.abs(evidence) / certain, 1.0).mean())


def _beyond_drift(distance: float) -> float:
    """Return the probability that the position was not off by this ``distance`` [m]."""
    return 1.0 - math.exp(-0.5 * (distance / _DRIFT) ** 2)


def _gone(plan: OccupancyMap, grid: GrownGrid, moved: Sequence[MapChange]) -> list[MapChange]:
    """Return the openings in walls of ``plan``, and its things on which the body has room now."""
    room = room_on(plan, grid)
    evidence = grid.evidence_at(centres_of(plan)).reshape(room.shape)
    changes = list[MapChange]()
    free = plan.occupied & without_gaps(evidence <= FREE_BELOW)
    for part in _parts(free, plan, _MIN_OPENING_AREA):
        if _is_wall(plan, part):
            changes += _new_openings(grid, plan.centres(*np.nonzero(part)))
    for part in _parts(plan.occupied & (room >= ROOM), plan, _MIN_AREA):
        if not _is_wall(plan, part):
            certainty = _sureness(evidence[part]) * _beyond_drift(float(room[part].max()))
            detail = f"at least {part.sum() * plan.resolution**2:.2f} m2"
            changes.append(MapChange("gone", "a thing", *_middle(plan, part), certainty, detail))
    kept = list(moved)
    for change in changes:
        if all(math.dist((change.x, change.y), (c.x, c.y)) > _SAME for c in kept):
            kept.append(change)
    return kept[len(moved) :]


def _parts(mask: Mask, plan: OccupancyMap, least: float) -> list[Mask]:
    """Return the connected parts of ``mask`` that have the ``least`` area [m^2]."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] * plan.resolution**2 >= least
    return [labels == k for k in range(1, count) if large[k]]


def _middle(plan: OccupancyMap, part: Mask) -> Point:
    x, y = plan.centres(*np.nonzero(part)).mean(axis=0).tolist()
    return x, y


def _new_openings(grid: GrownGrid, wall: Array) -> list[MapChange]:
    """Return the openings at cells of a ``wall`` (n, 2) [m] that are seen free."""
    tx, ty, x, y = cv2.fitLine(wall.astype(np.float32), cv2.DIST_L2, 0, 0.01, 0.01)[:, 0].tolist()
    reach = 0.5 * math.dist(wall.min(axis=0), wall.max(axis=0))
    along = np.arange(-_ALONG - reach, _ALONG + reach + 1e-9, grid.cell)
    blocked, clear, evidence = _wall(grid, (x, y), (ty, -tx), along)
    changes = []
    for left, right in _openings(clear, grid.cell):
        if along[right] >= -reach and along[left] <= reach:
            offset, edges = 0.5 * float(along[left] + along[right]), _edges(blocked, left, right)
            certainty = _sureness(evidence[left : right + 1]) * _EDGES[sum(edges)]
            at, wide = (x + offset * tx, y + offset * ty), (right - left + 1) * grid.cell
            detail = f"{wide:.1f} m wide"
            changes.append(MapChange("new", "an opening", *at, certainty, detail, None, ty, -tx))
    return changes


def _is_wall(plan: OccupancyMap, part: Mask) -> bool:
    """Return whether ``part`` of the plan has free ground on two sides, not joined around it."""
    reach = 2 * round(_AROUND / plan.resolution) + 1
    near = cv2.dilate(part.view(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    beside = (near & plan.free).view(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(beside, connectivity=4)
    sizes = sorted(stats[1:, cv2.CC_STAT_AREA].tolist())
    return len(sizes) > 1 and sizes[-2] >= 0.3 * sizes[-1]


def _differences(a: TopoMap, b: TopoMap) -> list[MapChange]:
    """Return how map ``b`` differs from ``a``."""
    if 2 * len(a.places.keys() & b.places.keys()) < len(a.places):
        if b.floor_plan is None:
            what = f"shares few places with {a.name!r} and has no floor plan to compare"
            raise InputError(what, file=b.file)
        return changes_between(a, grid_of(b.floor_plan))
    changes = list[MapChange]()
    for place in a.places.values():
        now = b.places.get(place.name)
        if now is None:
            changes.append(MapChange("closed", place.name, place.x, place.y, 1.0))
        elif (off := place.distance(now.x, now.y)) >= _SHIFT and place.kind == "door":
            dx, dy = now.x - place.x, now.y - place.y
            detail = f"by {off:.1f} m"
            changes.append(MapChange("moved", place.name, now.x, now.y, 1.0, detail, None, dx, dy))
    before, after = ({passage.ends for passage in one.passages} for one in (a, b))
    left = [p for p in a.passages if p.ends not in after and p.ends <= b.places.keys()]
    changes += [_at_passage("closed", a, passage) for passage in left]
    added = b.places.keys() - a.places.keys()
    parts = nx.connected_components(b.graph.subgraph(added))
    changes += [_new_way(b, sorted(part)) for part in parts]
    new = [p for p in b.passages if p.ends not in before and not p.ends & added]
    changes += [_at_passage("new", b, passage) for passage in new]
    if a.floor_plan is not None and b.floor_plan is not None:
        things = _gone(a.floor_plan, grid_of(b.floor_plan), [])
        changes += [change for change in things if change.kind == "gone"]
    return changes


def _new_way(topo_map: TopoMap, names: Sequence[str]) -> MapChange:
    """Return the change for places ``names`` that are new: a way between those they lead to."""
    ends = sorted({p.other(name) for name in names for p in topo_map.passages_at(name)} - {*names})
    middle = topo_map.places[names[len(names) // 2]]
    return MapChange("new", f"way from {' to '.join(ends) or 'nowhere'}", middle.x, middle.y, 1.0)


def _at_passage(kind: ChangeKind, topo_map: TopoMap, passage: Passage) -> MapChange:
    ends = [topo_map.places[name] for name in (passage.a, passage.b)]
    x, y = (0.5 * (ends[0].x + ends[1].x), 0.5 * (ends[0].y + ends[1].y))
    return MapChange(kind, str(passage), x, y, 1.0)


def room_on(plan: OccupancyMap, grid: GrownGrid) -> Array:
    """Distances (rows, columns) [m] of the cells of ``plan`` to what was not surely seen free."""
    free = without_gaps(grid.log_odds <= _SURELY_FREE)
    away = distances(~free | grid.occupied, grid.cell)
    room = np.minimum(away / grid.cell, 127.0).astype(np.int8)
    near = GrownGrid(room, grid.origin, grid.cell).evidence_at(centres_of(plan))
    return np.asarray(grid.cell * near.reshape(plan.cells.shape))


def centres_of(plan: OccupancyMap) -> Array:
    """Centres (n, 2) [m] of the cells of ``plan``, row by row."""
    rows, columns = np.indices(plan.cells.shape).reshape(2, -1)
    return plan.centres(rows, columns)
