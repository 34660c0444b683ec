"""Makes maps from a grown grid: floor plan, places, doors and passages; corrects a given map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from navfw.errors import InputError
from navfw.localmap.cell_arrays import cell_disc, distances, small_spots
from navfw.mapping.map_changes import ROOM, MapChange, centres_of, room_on
from navfw.mapping.matching import plan_of
from navfw.numerics import Array, Mask
from navfw.signals import GrownGrid, Pose
from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, Evidence
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.clearance_grid import ClearanceGrid
from navfw.topomap.map_builder import MARGIN, build_map
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap
from navfw.topomap.sharpening import sharpened

_SPECK = 0.06  # chosen
"""Largest area [m^2] of unseen spots amid free ground that count as free: gaps between rays."""

_DOT, _SURE = 2, 64  # chosen
"""Largest number of cells of an occupied spot that counts as free, unless its evidence is sure."""

_NARROW = 0.75  # chosen
"""Half the width of a gap that counts as closed, relative to the robot's radius."""

_ROUGHNESS = 0.05  # measured
"""Roughness of walls [m]: a cell."""

_NEAR_DROP = 0.6  # chosen
"""Distance [m] from missing floor up to which a passage has ``danger``."""

_BESIDE = 1.0  # chosen
"""Distance [m] up to which the places before and after a door are moved with it."""
_STEP = 0.7  # chosen
"""Distance from a new opening of the places before and after it [m]."""
_APART = 0.2  # chosen
"""Distance [m] from occupied cells of the plan at which occupied evidence is a new thing."""


def cleaned_grid(grid: GrownGrid) -> GrownGrid:
    """Return ``grid`` with walls as thin as surfaces, and without specks in its free ground."""
    evidence = sharpened(grid.log_odds, continuous=True)
    sharp = GrownGrid(evidence, grid.origin, grid.cell)
    occupied = sharp.occupied & ~_dots(evidence, sharp.occupied)
    free = sharp.free | (sharp.occupied & ~occupied)
    free |= _specks(~free & ~occupied, occupied, _SPECK / grid.cell**2)
    evidence = evidence.copy()
    evidence[free] = np.minimum(evidence[free], FREE_BELOW)
    return GrownGrid(evidence, grid.origin, grid.cell)


def _dots(evidence: Evidence, occupied: Mask) -> Mask:
    """Return the occupied cells of spots that are small, and not sure."""
    labels, small = small_spots(occupied, _DOT, 8)
    small[labels[evidence >= _SURE]] = False
    dots: Mask = small[labels]
    return dots


def _specks(unseen: Mask, occupied: Mask, largest: float) -> Mask:
    """Return the ``unseen`` cells of spots up to ``largest`` [cells] that touch nothing occupied.

    Beside something occupied they may be a part of a wall that was not seen.
    """
    labels, small = small_spots(unseen, largest, 4)
    beside = cv2.dilate(occupied.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    small[labels[beside]] = False
    specks: Mask = small[labels]
    return specks


def made_map(name: str, grid: GrownGrid, radius: float, drops: Array | None = None) -> TopoMap:
    """Make the map ``name`` of ``grid`` for a robot of ``radius`` [m], with its floor plan.

    ``drops`` (n, 2) [m, map] are spots whose floor is missing: passages that lead past
    them are a danger.

    Raises:
        MapError: no ground is free for the robot.

    """
    plan = plan_of(cleaned_grid(grid))
    made = build_map(name, clearances_of(plan, radius), radius=radius, roughness=_ROUGHNESS)
    if drops is not None and len(drops):
        made = _with_dangers(made, drops)
    return TopoMap(name, made.places.values(), made.passages, floor_plan=plan)


def clearances_of(plan: OccupancyMap, radius: float) -> ClearanceGrid:
    """Distances [m] on ``plan`` to cells that are not known to be free.

    Gaps that are far too narrow for a robot of ``radius`` [m] count as closed, as some parts of
    walls are not seen.
    """
    disc = cell_disc(round(_NARROW * radius / plan.resolution)).view(np.uint8)
    free = cv2.morphologyEx(np.pad(plan.free, 1).view(np.uint8), cv2.MORPH_OPEN, disc) > 0
    away = distances(~free, plan.resolution)[1:-1, 1:-1]
    x, y = plan.origin.to_parent(0.5 * plan.resolution, 0.5 * plan.resolution)
    return ClearanceGrid((x, y), plan.resolution, away - 0.5 * plan.resolution)


def _with_dangers(topo_map: TopoMap, drops: Array) -> TopoMap:
    """Return the map with danger on the passages that lead past ``drops`` (n, 2) [m]."""
    near = [
        projection.passage.ends
        for x, y in drops.tolist()
        for projection in topo_map.project_onto_passages(x, y, slack=_NEAR_DROP)
        if projection.aside < _NEAR_DROP
    ]
    passages = [replace(p, danger=1.0) if p.ends in near else p for p in topo_map.passages]
    return topo_map.replaced(passages=passages)


def with_place(topo_map: TopoMap, name: str, pose: Pose, radius: float) -> TopoMap:
    """Return the map with a place ``name`` at ``pose``, and passages to the nearest in sight.

    ``radius`` [m] is that of the robot that the map is for.

    Raises:
        InputError: the map has such a place already, or no floor plan.

    """
    if name in topo_map.places:
        raise InputError(f"the map has a place {name!r} already; choose another name")
    plan = topo_map.floor_plan
    if plan is None:
        raise InputError("the map has no floor plan")
    grid, need = clearances_of(plan, radius), radius + MARGIN
    at = round(pose.x, 2), round(pose.y, 2)
    order = topo_map.place_distances(*at).argsort(kind="stable").tolist()
    near = [list(topo_map.places.values())[i] for i in order]
    near = [place for place in near if place.kind != "danger"]
    sight = [p for p in near if grid.along(at, (p.x, p.y)) >= min(need, grid.at(*at)) - 0.03]
    place, passages = Place(name, *at), []
    for other in (sight or near)[:2]:
        length, width = other.distance(*at), 2.0 * grid.along(at, (other.x, other.y))
        passages.append(Passage(name, other.name, max(length, 0.01), max(width, 0.05)))
    return topo_map.extended([place], passages)


def corrected_map(
    topo_map: TopoMap, grid: GrownGrid, changes: Sequence[MapChange], radius: float, name: str
) -> TopoMap:
    """Return the map ``name`` with the ``changes``, for a robot of ``radius`` [m].

    Its floor plan, if it has one, is updated with what was seen. A new opening needs a floor plan
    to be joined to the places on both sides.

    Raises:
        MapError: without its closed passages the map is empty.

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
    left = [place for place in places.values() if place.name not in closed]
    plan = None if topo_map.floor_plan is None else _with_seen(topo_map.floor_plan, grid)
    made = topo_map.replaced(name=name, places=left, passages=passages, floor_plan=plan)
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
    width = 2.0 * (radius + ROOM)
    new = [Passage(p.name, name, door.distance(p.x, p.y), width, doorness=1.0) for p in sides]
    return topo_map.extended([door], new)


def _with_seen(plan: OccupancyMap, grid: GrownGrid) -> OccupancyMap:
    """Return ``plan`` with what was seen: free ground, and things away from those of the plan."""
    cells = plan.cells.copy()
    seen = grid.evidence_at(centres_of(plan)).reshape(cells.shape) >= OCCUPIED_FROM
    cells[room_on(plan, grid) >= ROOM] = FREE
    cells[seen & (distances(plan.occupied, plan.resolution) >= _APART)] = OCCUPIED
    return replace(plan, cells=cells, file=None)
