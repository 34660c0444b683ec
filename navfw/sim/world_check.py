"""Checks of a world specification beyond its schema: names, references, geometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.yaml_text import KeyPath, key_text
from navfw.errors import WorldError, did_you_mean
from navfw.features.landmark_appearance import identity_of, plate_side
from navfw.sim.shapes import OVERLAP_TOLERANCE, Circle, Rectangle, Shape, overlap_depth
from navfw.sim.solids import Solid, drop_rectangle, opening_segment, solids_of, wall_segments
from navfw.sim.surface_patches import plate_axes
from navfw.sim.textures import STOCK
from navfw.sim.worldspec import LandmarkPlateSpec, Point, WalkerSpec, WorldSpec

Problem = tuple[KeyPath, str]
"""The key of a problem, and its message."""

_DEPTH_TOLERANCE = 0.03
"""Distance [m] by which a plate's ends may stand off the supporting face, or lie inside it."""
_MIN_HEIGHT = 0.02
"""Smallest height of a plate's lower edge above the floor [m]."""
_ON_FLOOR = 0.05
"""Height [m] of a solid's underside below which it needs floor under it."""
_SUNKEN = 0.005
"""Largest depth [m] of a mesh below the floor: modelled feet are not exactly level."""


def _landmarks(world: WorldSpec) -> Iterator[Problem]:
    seen: dict[str, int] = {}
    solids = solids_of(world) if world.landmarks else []
    for i, mark in enumerate(world.landmarks):
        identity = identity_of(mark.kind, mark.id)
        if identity in seen:
            yield (
                ("landmarks", i, "id"),
                f"a second {identity}: landmarks[{seen[identity]}] has that id; give each landmark"
                " of a kind its own",
            )
        seen.setdefault(identity, i)
        half = 0.5 * plate_side(mark.kind, mark.size)
        if mark.z - half < _MIN_HEIGHT:
            yield (
                ("landmarks", i, "z"),
                f"{mark.name!r} reaches into the floor: its plate is {2 * half:.2f} m high, so z"
                f" must be at least {half + _MIN_HEIGHT:.2f}",
            )
        else:
            yield from _mounting_problems(mark, i, half, solids)


def _mounting_problems(
    mark: LandmarkPlateSpec, index: int, half: float, solids: Sequence[Solid]
) -> Iterator[Problem]:
    """Yield a plate inside a solid, or without a supporting face behind both of its ends.

    ``half`` is half the plate's side [m].
    """
    overlapping = [s for s in solids if s.bottom < mark.z + half and s.top > mark.z - half]
    full_height = [
        s
        for s in solids
        if s.kind != "mesh" and s.bottom <= mark.z - half and s.top >= mark.z + half
    ]
    right, normal = plate_axes(mark)
    ends = np.array([[*mark.at], [*mark.at]]) + half * np.outer([-1.0, 1.0], right[:2])
    in_front = ends + _DEPTH_TOLERANCE * normal[:2]
    enclosing = [s for s in overlapping if bool((s.shape.distance(in_front) < 0.0).any())]
    if enclosing:
        yield (
            ("landmarks", index, "at"),
            f"{mark.name!r} lies inside {enclosing[0].name!r}: move it to the face, or turn it"
            " round (yaw is the direction that it faces)",
        )
    elif not mark.free and not all(
        any(s.shape.distance(point[None])[0] <= 0.0 for s in full_height)
        for point in ends - _DEPTH_TOLERANCE * normal[:2]
    ):
        yield (
            ("landmarks", index, "at"),
            f"{mark.name!r} is not mounted on a face: no wall or box is right behind the whole of"
            f" its plate of {2 * half:.2f} m; {_advice(mark, full_height)}",
        )


def _advice(mark: LandmarkPlateSpec, solids: Sequence[Solid]) -> str:
    """Return the nearest solid that the plate could be mounted on."""
    flat = [solid for solid in solids if isinstance(solid.shape, Rectangle)]
    if not flat:
        return "set free: true if it stands by itself"
    away, nearest = min(
        (float(s.shape.distance(np.array([mark.at]))[0]), i) for i, s in enumerate(flat)
    )
    what = f"the nearest is {flat[nearest].name!r}, {max(away, 0.0):.2f} m away; move it there"
    return f"{what}, or set free: true if it stands by itself"


def _drops(world: WorldSpec) -> Iterator[Problem]:
    solids = [s for s in solids_of(world) if s.bottom < _ON_FLOOR] if world.drops else []
    for i, drop in enumerate(world.drops):
        for axis, span, bounds in (("x", drop.x, world.x), ("y", drop.y, world.y)):
            if span[0] < bounds[0] or span[1] > bounds[1]:
                yield (
                    ("drops", i, axis),
                    f"{drop.name!r} extends beyond the floor, {axis} {list(bounds)} [m]",
                )
        shape = drop_rectangle(drop)
        above = next((s for s in solids if overlap_depth(shape, s.shape) > OVERLAP_TOLERANCE), None)
        if above is not None:
            yield ("drops", i, "x"), f"{above.name!r} would have no floor under it at {drop.name!r}"
        for other in world.drops[:i]:
            if overlap_depth(shape, drop_rectangle(other)) > 0.0:
                yield ("drops", i, "x"), f"{drop.name!r} overlaps {other.name!r}"
        for j, walker in enumerate(world.movers):
            if any(_swept_over(a, b, walker.radius, shape) for a, b in _legs(walker)):
                yield ("movers", j, "path"), f"{walker.name!r} would walk into {drop.name!r}"


def check_world(
    world: WorldSpec,
    *,
    file: Path | None = None,
    line_of: Callable[[KeyPath], int | None] | None = None,
) -> None:
    """Check names, references and geometry of a world.

    ``file`` and ``line_of``, which gives the line of a key in it, locate the errors.

    Raises:
        WorldError: with file, line and key of the first problem; its message lists the others.

    """
    problems = [*_names(world), *_textures(world), *_bounds(world), *_walls(world), *_doors(world)]
    if not problems:  # the solids are defined only when walls, openings and doors are valid
        checks = (_overlaps, _blocked_paths, _sunken_meshes, _landmarks, _drops)
        problems = [p for check in checks[world.may_overlap :] for p in check(world)]
    if not problems:
        return

    line = line_of or (lambda _: None)
    (path, message), *others = problems
    for other_path, other in others:
        where = f"{file}:{line(other_path)}: " if file is not None else ""
        message += f"\n{where}{key_text(other_path)}: {other}"
    raise WorldError(message, file=file, line=line(path), key=key_text(path))


def _bodies(world: WorldSpec) -> Iterator[tuple[KeyPath, Any]]:
    for section in ("walls", "doors", "boxes", "cylinders", "meshes", "movers"):
        yield from (((section, i), item) for i, item in enumerate(getattr(world, section)))


def _names(world: WorldSpec) -> Iterator[Problem]:
    bodies = [((*path, "name"), item.name) for path, item in _bodies(world)]
    bodies += [(("landmarks", i, "name"), mark.name) for i, mark in enumerate(world.landmarks)]
    bodies += [(("drops", i, "name"), drop.name) for i, drop in enumerate(world.drops)]
    openings: list[tuple[KeyPath, str]] = [
        (("walls", i, "openings", j, "name"), opening.name)
        for i, wall in enumerate(world.walls)
        for j, opening in enumerate(wall.openings)
    ]
    rooms: list[tuple[KeyPath, str]] = [
        (("rooms", i, "name"), room.name) for i, room in enumerate(world.rooms)
    ]
    for what, items in (("body", bodies), ("opening", openings), ("room", rooms)):
        seen: dict[str, KeyPath] = {"floor": ("floor",)} if what == "body" else {}
        for path, name in items:
            if name in seen:
                yield path, f"the {what} name {name!r} is taken by {key_text(seen[name])}"
            seen.setdefault(name, path)


def _textures(world: WorldSpec) -> Iterator[Problem]:
    textures = {*STOCK, *world.textures}
    for path, name, _ in world.texture_uses():
        if name not in textures:
            yield path, f"unknown texture {name!r}: {did_you_mean(name, textures)}"


def _bounds(world: WorldSpec) -> Iterator[Problem]:
    def inside(x: float, y: float) -> bool:
        return world.x[0] <= x <= world.x[1] and world.y[0] <= y <= world.y[1]

    floor = f"the floor, x {list(world.x)} y {list(world.y)} [m]"
    for section, key in (("walls", "points"), ("movers", "path")):
        for i, item in enumerate(getattr(world, section)):
            for j, point in enumerate(getattr(item, key)):
                if not inside(*point):
                    yield (section, i, key, j), f"point {list(point)} lies off {floor}"
    for section in ("boxes", "cylinders", "meshes", "landmarks"):
        for i, item in enumerate(getattr(world, section)):
            if not inside(*item.at):
                yield (section, i, "at"), f"{item.name!r} at {list(item.at)} lies off {floor}"


def _walls(world: WorldSpec) -> Iterator[Problem]:
    for i, wall in enumerate(world.walls):
        for j, segment in enumerate(wall_segments(wall)):
            if segment.length < 0.01:
                yield ("walls", i, "points", j + 1), "two points of a wall are in the same place"
                return
        placed: list[tuple[int, float, float, str]] = []
        for j, opening in enumerate(wall.openings):
            index = opening_segment(wall, opening)
            path = ("walls", i, "openings", j)
            if index is None:
                yield (
                    (*path, "at"),
                    f"the opening {opening.name!r}, {opening.width:g} m wide around"
                    f" {list(opening.at)}, does not lie on the line of wall {wall.name!r}",
                )
                continue
            along = wall_segments(wall)[index].locate(opening.at)[0]
            low, high = along - 0.5 * opening.width, along + 0.5 * opening.width
            for other, other_low, other_high, name in placed:
                if other == index and low < other_high and other_low < high:
                    yield (*path, "at"), f"the opening {opening.name!r} overlaps {name!r}"
            placed.append((index, low, high, opening.name))


def _doors(world: WorldSpec) -> Iterator[Problem]:
    openings = {opening.name for wall in world.walls for opening in wall.openings}
    for i, door in enumerate(world.doors):
        if door.opening not in openings:
            hint = did_you_mean(door.opening, openings)
            yield ("doors", i, "opening"), f"no wall has an opening {door.opening!r}: {hint}"


def _overlaps(world: WorldSpec) -> Iterator[Problem]:
    solids = solids_of(world)
    paths = {item.name: path for path, item in _bodies(world)}
    # bounding boxes (N, 4): min x, min y, max x, max y; they rule out most pairs
    bounds = np.array([solid.shape.bounds for solid in solids]).reshape(-1, 4)
    for i, solid in enumerate(solids):
        if solid.kind in ("wall", "lintel", "door"):
            continue  # walls may cross; doors touch the pieces of their wall
        near = np.all(bounds[:i, 2:] >= bounds[i, :2], axis=1)
        near &= np.all(bounds[:i, :2] <= bounds[i, 2:], axis=1)
        for other in (solids[j] for j in np.flatnonzero(near)):
            below = solid.top - OVERLAP_TOLERANCE <= other.bottom
            above = other.top - OVERLAP_TOLERANCE <= solid.bottom
            if other.name == solid.name:
                continue  # the parts of one mesh
            if below or above or overlap_depth(solid.shape, other.shape) <= OVERLAP_TOLERANCE:
                continue
            yield (*paths[solid.name], "at"), f"{solid.name!r} overlaps {other.name!r}"
            break


def _sunken_meshes(world: WorldSpec) -> Iterator[Problem]:
    """Meshes that reach below the floor, which would hide a part of them."""
    lowest: dict[str, float] = {}
    for solid in solids_of(world):
        lowest[solid.name] = min(lowest.get(solid.name, math.inf), solid.bottom)
    for i, mesh in enumerate(world.meshes):
        if (low := lowest.get(mesh.name, 0.0)) < -_SUNKEN:
            depth = -low
            what = f"{mesh.name!r} reaches {depth:.2f} m below the floor; raise base to"
            yield ("meshes", i, "base"), f"{what} {mesh.base + depth:.3g}"


def _blocked_paths(world: WorldSpec) -> Iterator[Problem]:
    """Walkers whose path leads through a solid: the area swept on each leg is tested."""
    solids = solids_of(world)
    for i, walker in enumerate(world.movers):
        low = [solid for solid in solids if solid.bottom < walker.height]
        for j, (a, b) in enumerate(_legs(walker)):
            hit = next((s.name for s in low if _swept_over(a, b, walker.radius, s.shape)), None)
            if hit is not None:
                yield ("movers", i, "path", j), f"{walker.name!r} would walk through {hit!r}"
                break


def _legs(walker: WalkerSpec) -> Iterator[tuple[Point, Point]]:
    return pairwise((*walker.path, walker.path[0]) if walker.walk == "loop" else walker.path)


def _swept_over(a: Point, b: Point, radius: float, shape: Shape) -> bool:
    """Whether a circle of ``radius`` [m] that moves straight from a to b overlaps the shape."""
    middle = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
    yaw = math.atan2(b[1] - a[1], b[0] - a[0])
    swept: tuple[Shape, ...] = (
        Rectangle(*middle, 0.5 * math.dist(a, b), radius, yaw),
        Circle(*a, radius),
        Circle(*b, radius),
    )
    return any(overlap_depth(shape, part) > OVERLAP_TOLERANCE for part in swept)
