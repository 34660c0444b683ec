"""Landmarks of a world: thin plates in front of walls, seen from one side, touched by nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from navfw.landmark_appearance import identity_of, plate_side
from navfw.signals import Array
from navfw.sim.layout import Solid, solids_of
from navfw.sim.meshes import Mesh
from navfw.sim.shapes import Rectangle
from navfw.sim.visibility import Outline
from navfw.sim.worldfile import LandmarkSpec, WorldSpec

__all__ = ["plate_mesh", "plate_outline", "plate_problems"]

_STAND_OFF = 0.006
"""How far [m] a plate stands off its wall: more than the skin of one without texture."""
_REACH = 0.03
"""A plate's ends may lie so far [m] in front of what it hangs on, or in it."""
_RIM = 1e-3
"""What is left out of the texture at each side: beyond it, it repeats."""
_LOWEST = 0.02

Problem = tuple[tuple[str | int, ...], str]


def plate_mesh(mark: LandmarkSpec) -> Mesh:
    """The plate as a mesh in the map, its picture upright for who stands in front of it."""
    right, normal = _axes(mark)
    half = 0.5 * plate_side(mark.kind, mark.size)
    middle = np.array([*mark.at, mark.z]) + _STAND_OFF * normal
    up = np.array([0.0, 0.0, half])
    across = half * right
    corners = [
        middle - across - up,
        middle + across - up,
        middle + across + up,
        middle - across + up,
    ]
    low, high = _RIM, 1.0 - _RIM
    return Mesh(
        vertices=[corner.tolist() for corner in corners],
        normals=[normal.tolist()] * 4,
        uvs=[[low, low], [high, low], [high, high], [low, high]],
        indices=[0, 1, 2, 0, 2, 3],
    )


def plate_outline(mark: LandmarkSpec) -> Outline:
    """Where the plate is in the plan, and from where it is seen at all."""
    _, normal = _axes(mark)
    points = np.array(plate_mesh(mark).vertices)
    plane = (float(normal[0]), float(normal[1]), 0.0, float(points[0] @ normal))
    return Outline.around(points, mark.yaw + 0.5 * math.pi, plane)


def plate_problems(world: WorldSpec) -> Iterator[Problem]:
    """What is wrong with the landmarks of a world whose solids are right."""
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
        if mark.z - half < _LOWEST:
            yield (
                ("landmarks", i, "z"),
                f"{mark.name!r} reaches into the floor: its plate is {2 * half:.2f} m high, so z"
                f" must be at least {half + _LOWEST:.2f}",
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
            yield from _misplaced(mark, i, half, solids)


def _misplaced(
    mark: LandmarkSpec, index: int, half: float, solids: Sequence[Solid]
) -> Iterator[Problem]:
    """Whether the plate hangs on something, with nothing in front of it."""
    beside = [s for s in solids if s.bottom < mark.z + half and s.top > mark.z - half]
    whole = [s for s in solids if s.bottom <= mark.z - half and s.top >= mark.z + half]
    right, normal = _axes(mark)
    ends = np.array([[*mark.at], [*mark.at]]) + half * np.outer([-1.0, 1.0], right[:2])
    inside = [solid for solid in beside if _within(solid, ends + _REACH * normal[:2])]
    if inside:
        yield (
            ("landmarks", index, "at"),
            f"{mark.name!r} lies in {inside[0].name!r}: move it to the face, or turn it round: yaw"
            " is where it faces",
        )
    elif not mark.free and not all(_backed(whole, end - _REACH * normal[:2]) for end in ends):
        yield (
            ("landmarks", index, "at"),
            f"{mark.name!r} hangs in the air, at least in part: no wall or box is right behind its"
            f" plate of {2 * half:.2f} m; {_advice(mark, whole)}",
        )


def _backed(solids: Sequence[Solid], point: Array) -> bool:
    return any(float(solid.shape.distance(point[None])[0]) <= 0.0 for solid in solids)


def _within(solid: Solid, points: Array) -> bool:
    return bool((solid.shape.distance(points) < 0.0).any())


def _advice(mark: LandmarkSpec, solids: Sequence[Solid]) -> str:
    """The nearest thing that could carry the plate."""
    flat = [solid for solid in solids if isinstance(solid.shape, Rectangle)]
    if not flat:
        return "say free: true if it stands by itself"
    away = [float(solid.shape.distance(np.array([mark.at]))[0]) for solid in flat]
    nearest = int(np.argmin(away))
    return (
        f"the nearest is {flat[nearest].name!r}, {max(away[nearest], 0.0):.2f} m off; move it"
        " there, or say free: true if it stands by itself"
    )


def _axes(mark: LandmarkSpec) -> tuple[Array, Array]:
    """The plate's right, seen by who looks at it, and where it faces: unit vectors (3,)."""
    c, s = math.cos(mark.yaw), math.sin(mark.yaw)
    return np.array([-s, c, 0.0]), np.array([c, s, 0.0])
