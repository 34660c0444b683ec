"""What differs between a map and what was seen of the building: doors, new openings, furniture.

Each door of the map is a gap in a wall. Along that wall, what was seen shows where the gap is now,
or that there is none. A wall or a thing of the floor plan is gone where the robot's body has room
on it.
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
from navfw.mapping.map_making import with_place
from navfw.numerics import Array, Mask
from navfw.signals import GrownGrid, Pose
from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, SCALE
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

Point = tuple[float, float]
ChangeKind = Literal["closed", "moved", "new", "gone"]

_ALONG, _DEEP, _INNER = 1.6, 0.3, 0.15  # chosen
"""Half the length [m] of wall that is looked at beside a door, half its depth, and half the depth
that has to be free in an opening."""
_SEEN = 0.7  # chosen
"""Share of the depth of an opening that has to be seen free: some rays are missing."""
_GAP = np.ones((1, 3), np.uint8)  # defined
"""Structuring element that closes gaps of a cell along a wall."""
_SURELY_FREE = -24  # measured
"""Evidence from which a wall or thing of the plan is gone: in five drives it was -37 where one was,
and -9 to -22 where rays had passed over it, or beside a wall."""
_OPENING = 0.45  # chosen
"""Least width [m] of an opening."""
_SHIFT, _OTHER = 0.25, 0.4  # chosen
"""Distance [m] from which a door has moved, and within which an opening is that of another door."""
_CLOSED, _NOT_FREE = 0.7, 0.1  # chosen
"""Least share of a door's width that is seen occupied, and largest share seen free, if closed."""
_ROOM = 0.15  # chosen
"""Clearance [m] from which a wall or thing of the plan is gone: poses are off by up to 0.1 m."""
_MIN_AREA, _MIN_OPENING_AREA = 0.1, 0.025  # chosen
"""Least area [m^2] of the middle of a thing that is gone, and of an opening: walls are thin."""
_AROUND = 0.45  # chosen
"""Distance [m] around what is gone in which free ground of the plan tells a wall from a thing."""
_SAME = 0.8  # chosen
"""Distance [m] up to which what is gone belongs to a door that has moved."""
_BESIDE = 1.0  # chosen
"""Distance [m] up to which the places before and after a door move along with it."""
_STEP = 0.7  # chosen
"""Distance [m] of the places before and after a new opening from it."""
_APART = 0.2  # chosen
"""Distance [m] from what the plan shows occupied at which something seen occupied is new."""


@dataclass(frozen=True, slots=True)
class MapChange:
    """A difference at x, y [m, map]: a passage ``closed``, ``moved`` or ``new``, or a thing gone.

    ``what`` is the door or passage of the map, ``detail`` says how it differs, ``time`` [s] when it
    was seen last, ``certainty`` in [0, 1] how sure the evidence is. ``dx``, ``dy`` [m] is how far a
    door has moved, or the direction (length 1) through a new opening.
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
    """Return a floor plan as a grid of sure evidence. Its axes must be those of the frame."""
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
    """Return how what was ``seen``, or a later map, differs from ``topo_map``, doors first.

    Maps are compared by names, if the later one has most places of the other; else by its plan.
    ``closed`` are passages that the planner has found closed, ``found`` the names and tracks (x, y)
    [m] of ways that it has found.
    ``last_seen`` returns the time [s] at which the point x, y [m] was seen last.

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
        if not judged & {passage.a, passage.b}:
            change = _at_passage("closed", topo_map, passage)
            changes.append(replace(change, certainty=0.5, detail="the robot got no further"))
    if topo_map.floor_plan is not None:
        moved = [change for change in changes if change.kind == "moved"]
        changes += _gone(topo_map.floor_plan, grid, moved)
    for name, track in found:
        through = [c for c in changes if c.kind == "new" and _nearest(track, c) <= _SAME]
        x, y = (through[0].x, through[0].y) if through else track[len(track) // 2]
        changes = [change for change in changes if change not in through]
        changes.append(MapChange("new", name, x, y, 1.0, "driven"))
    return [replace(change, time=last_seen(change.x, change.y)) for change in changes]


def _nearest(track: Sequence[Point], change: MapChange) -> float:
    return min(math.dist(point, (change.x, change.y)) for point in track)


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
    openings = [
        (left, right)
        for left, right in _runs(clear)
        if along[right] - along[left] + grid.cell >= _OPENING
    ]
    sure = float(np.abs(evidence[inner]).mean()) / (2.0 * SCALE)
    offsets = [0.5 * float(along[left] + along[right]) for left, right in openings]
    if offsets:
        nearest = min(range(len(offsets)), key=lambda k: abs(offsets[k]))
        offset, (left, right) = offsets[nearest], openings[nearest]
        has_edges = blocked[max(left - 2, 0) : left].any() and blocked[right + 1 : right + 3].any()
        at = door.x + offset * tangent[0], door.y + offset * tangent[1]
        is_other = any(
            other is not door and math.dist(at, (other.x, other.y)) <= _OTHER for other in doors
        )
        if abs(offset) < _SHIFT or (clear[inner].all() and not has_edges):
            return None
        if has_edges and not is_other:
            detail = f"by {abs(offset):.1f} m, {along[right] - along[left] + grid.cell:.1f} m wide"
            dx, dy = offset * tangent[0], offset * tangent[1]
            certainty = min(sure, 1.0)
            return MapChange("moved", door.name, *at, certainty, detail, None, dx, dy)
    if blocked[inner].mean() >= _CLOSED and clear[inner].mean() <= _NOT_FREE:
        certainty = min(sure, 1.0) * float(blocked[inner].mean())
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


def _gone(plan: OccupancyMap, grid: GrownGrid, moved: Sequence[MapChange]) -> list[MapChange]:
    """Return the walls and things of ``plan`` on which the body has room now."""
    mask = (plan.occupied & (_room_on(plan, grid) >= _ROOM)).view(np.uint8)
    count, labels, stats, middles = cv2.connectedComponentsWithStats(mask, connectivity=8)
    changes = []
    for k in range(1, count):
        area = int(stats[k, cv2.CC_STAT_AREA]) * plan.resolution**2
        x, y = plan.centres(np.array([middles[k][1]]), np.array([middles[k][0]]))[0].tolist()
        if area < _MIN_OPENING_AREA or any(math.dist((x, y), (c.x, c.y)) <= _SAME for c in moved):
            continue
        direction = _through(plan, labels == k)
        if direction is None and area < _MIN_AREA:
            continue
        if direction is None:
            changes.append(MapChange("gone", "a thing", x, y, 0.8, f"at least {area:.2f} m2"))
        else:
            changes.append(MapChange("new", "an opening", x, y, 0.8, "", None, *direction))
    return changes


def _through(plan: OccupancyMap, part: Mask) -> Point | None:
    """Return the direction through a wall whose ``part`` is gone; None if it is no wall.

    A wall has free ground on two sides that does not join around the part.
    """
    reach = 2 * round(_AROUND / plan.resolution) + 1
    near = cv2.dilate(part.view(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    _, _, stats, middles = cv2.connectedComponentsWithStats(
        (near & plan.free).view(np.uint8), connectivity=4
    )
    sizes = stats[1:, cv2.CC_STAT_AREA]
    if len(sizes) < 2:
        return None
    first, second = sorted(range(1, len(sizes) + 1), key=lambda k: -int(sizes[k - 1]))[:2]
    if stats[second, cv2.CC_STAT_AREA] < 0.3 * stats[first, cv2.CC_STAT_AREA]:
        return None
    dx, dy = (middles[second] - middles[first]).tolist()
    length = math.hypot(dx, dy)
    yaw = plan.origin.yaw + math.atan2(dy, dx)
    return None if length == 0.0 else (math.cos(yaw), math.sin(yaw))


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


# --- the corrected map ---------------------------------------------------------------------------


def corrected_map(
    topo_map: TopoMap, grid: GrownGrid, changes: Sequence[MapChange], radius: float, name: str
) -> TopoMap:
    """Return the map ``name`` with the ``changes``, for a robot of ``radius`` [m].

    What was seen of the floor is entered in its floor plan, if it has one. A new opening needs a
    floor plan to be joined to the places on both sides.

    Raises:
        MapError: without its closed passages nothing is left of the map.

    """
    closed = {change.what for change in changes if change.kind == "closed"}
    moved = {change.what: change for change in changes if change.kind == "moved"}
    places = {place.name: place for place in topo_map.places.values()}
    for door, change in moved.items():
        around = [places[p.other(door)] for p in topo_map.passages_at(door)]
        x, y = places[door].x, places[door].y
        near = [p for p in around if p.kind != "door" and p.distance(x, y) <= _BESIDE]
        for place in (places[door], *near):
            places[place.name] = replace(
                place, x=round(place.x + change.dx, 3), y=round(place.y + change.dy, 3)
            )
    kept = [p for p in topo_map.passages if str(p) not in closed and not closed & p.ends]
    passages = [replace(p, length=max(p.length, _length(places, p))) for p in kept]
    plan = topo_map.floor_plan
    if plan is not None:
        plan = _with_seen(plan, grid)
    left = [place for place in places.values() if place.name not in closed]
    made = TopoMap(name, left, passages, landmarks=topo_map.landmarks.values(), floor_plan=plan)
    if plan is None:
        return made
    number = 0
    for change in changes:
        if change.kind == "new" and change.dx**2 + change.dy**2 > 0.0:
            number += 1
            made = _with_opening(made, change, radius, f"opening-{number}")
    return made


def _length(places: dict[str, Place], passage: Passage) -> float:
    end = places[passage.b]
    return places[passage.a].distance(end.x, end.y)


def _with_opening(topo_map: TopoMap, change: MapChange, radius: float, name: str) -> TopoMap:
    """Return the map with the door ``name``, and the places before and after it."""
    door = Place(name, round(change.x, 2), round(change.y, 2), "door")
    sides = []
    for side, sign in (("before", -1.0), ("after", 1.0)):
        pose = Pose(change.x + sign * _STEP * change.dx, change.y + sign * _STEP * change.dy, 0.0)
        topo_map = with_place(topo_map, f"{name}-{side}", pose, radius)
        sides.append(topo_map.places[f"{name}-{side}"])
    width = 2.0 * (radius + _ROOM)
    new = [Passage(p.name, name, door.distance(p.x, p.y), width, doorness=1.0) for p in sides]
    return topo_map.extended([door], new)


def _with_seen(plan: OccupancyMap, grid: GrownGrid) -> OccupancyMap:
    """Return ``plan`` with what was seen: free ground, and things away from those of the plan."""
    cells = plan.cells.copy()
    seen = grid.evidence_at(_centres(plan)).reshape(cells.shape) >= OCCUPIED_FROM
    cells[_room_on(plan, grid) >= _ROOM] = FREE
    cells[seen & (distances(plan.occupied, plan.resolution) >= _APART)] = OCCUPIED
    return replace(plan, cells=cells, file=None)


def _room_on(plan: OccupancyMap, grid: GrownGrid) -> Array:
    """Return the distances (rows, columns) [m] on ``plan`` to what was not surely seen free."""
    free = without_gaps(grid.log_odds <= _SURELY_FREE)
    away = distances(~free | grid.occupied, grid.cell)
    room = np.minimum(away / grid.cell, 127.0).astype(np.int8)
    near = GrownGrid(room, grid.origin, grid.cell).evidence_at(_centres(plan))
    return np.asarray(grid.cell * near.reshape(plan.cells.shape))


def _centres(plan: OccupancyMap) -> Array:
    rows, columns = np.indices(plan.cells.shape).reshape(2, -1)
    return plan.centres(rows, columns)
