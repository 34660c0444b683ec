"""Checks of a world's landmarks: unique ids; plates within the floor's bounds, on a face."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from navfw.config.document import KeyPath
from navfw.features.landmark_appearance import identity_of, landmark_kind
from navfw.signals import Array
from navfw.sim.landmark_plates import plate_axes
from navfw.sim.shapes import Rectangle
from navfw.sim.solids import Solid, solids_of
from navfw.sim.worldspec import LandmarkPlateSpec, WorldSpec

_DEPTH_TOLERANCE = 0.03
"""Distance [m] by which a plate's ends may stand off the supporting face, or lie inside it."""
_MIN_HEIGHT = 0.02
"""Lowest height of a plate's lower edge above the floor [m]."""

Problem = tuple[KeyPath, str]


def landmark_problems(world: WorldSpec) -> Iterator[Problem]:
    """Problems of the landmarks of a world whose solids are valid: (key, message) of each."""
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
        half = 0.5 * landmark_kind(mark.kind).plate_side(mark.size)
        if mark.z - half < _MIN_HEIGHT:
            yield (
                ("landmarks", i, "z"),
                f"{mark.name!r} reaches into the floor: its plate is {2 * half:.2f} m high, so z"
                f" must be at least {half + _MIN_HEIGHT:.2f}",
            )
        elif not (
            world.x[0] <= mark.at[0] <= world.x[1] and world.y[0] <= mark.at[1] <= world.y[1]
        ):
            yield (
                ("landmarks", i, "at"),
                f"{mark.name!r} at {list(mark.at)} lies off the floor, x {list(world.x)} y"
                f" {list(world.y)} [m]",
            )
        else:
            yield from _mounting_problems(mark, i, half, solids)


def _mounting_problems(
    mark: LandmarkPlateSpec, index: int, half: float, solids: Sequence[Solid]
) -> Iterator[Problem]:
    """A plate inside a solid, or without a supporting face behind both of its ends.

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
        _inside_any(full_height, end - _DEPTH_TOLERANCE * normal[:2]) for end in ends
    ):
        yield (
            ("landmarks", index, "at"),
            f"{mark.name!r} is not mounted on a face: no wall or box is right behind the whole of"
            f" its plate of {2 * half:.2f} m; {_advice(mark, full_height)}",
        )


def _inside_any(solids: Sequence[Solid], point: Array) -> bool:
    return any(float(solid.shape.distance(point[None])[0]) <= 0.0 for solid in solids)


def _advice(mark: LandmarkPlateSpec, solids: Sequence[Solid]) -> str:
    """The nearest solid that the plate could be mounted on."""
    flat = [solid for solid in solids if isinstance(solid.shape, Rectangle)]
    if not flat:
        return "set free: true if it stands by itself"
    away = [float(solid.shape.distance(np.array([mark.at]))[0]) for solid in flat]
    nearest = int(np.argmin(away))
    return (
        f"the nearest is {flat[nearest].name!r}, {max(away[nearest], 0.0):.2f} m away; move it"
        " there, or set free: true if it stands by itself"
    )
