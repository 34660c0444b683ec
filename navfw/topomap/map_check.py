"""Problems of a valid map: unconnected parts, narrow passages, places in walls, wrong widths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import networkx as nx
import numpy as np

from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.topomap.topological_map import TopoMap

MapProblemKind = Literal[
    "apart", "narrow", "unreachable", "duplicate", "in-wall", "blocked", "width"
]

Clearances = Callable[[Array], Array]
"""Distances [m] of points (N, 2) in ``map`` to the nearest solid; negative inside one."""

_RADIUS = RobotModel().radius
"""Radius of the default robot [m]."""

_SAME_POINT = 0.05  # chosen
"""Distance [m] below which two places count as duplicates."""

STRAIGHT = 1.02  # chosen
"""Length over straight distance beyond which a passage is curved, its course unknown, and its
clearance not checked."""

_WIDTH_ROUNDING = 0.05  # chosen
"""Tolerance [m] of a passage's width in the map above its free width in the world."""

STEP = 0.02  # chosen
"""Spacing of the points at which a passage's clearance is checked [m]."""
_MAX_POINTS = 1_000_000  # chosen
"""Largest number of points of a passage: beyond 20 km they are farther apart."""


@dataclass(frozen=True, slots=True)
class MapProblem:
    """One problem for the map's author to inspect; ``where`` names the place or passage."""

    kind: MapProblemKind
    where: str
    message: str

    def as_data(self) -> dict[str, str]:
        """Return the problem as plain data."""
        return {"kind": self.kind, "where": self.where, "message": self.message}


def check_map(
    topo_map: TopoMap, clearances: Clearances | None = None, radius: float = _RADIUS
) -> list[MapProblem]:
    """Check ``topo_map`` for a robot of ``radius`` [m]; return all problems, none if it is sound.

    With ``clearances`` of the mapped world, places and straight passages are checked against walls.
    """
    problems = [*_unconnected_parts(topo_map), *_narrow_passages(topo_map, radius)]
    problems += _duplicates(topo_map)
    if clearances is not None:
        problems += _places_in_walls(topo_map, clearances, radius)
        problems += _blocked_passages(topo_map, clearances, radius)
    return problems


def _unconnected_parts(topo_map: TopoMap) -> Iterator[MapProblem]:
    for places in topo_map.parts[1:]:
        names = sorted(places)
        some = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
        yield MapProblem(
            "apart", names[0], f"no edge connects {some} with the rest of the map; add one"
        )


def _narrow_passages(topo_map: TopoMap, radius: float) -> Iterator[MapProblem]:
    need = 2.0 * radius
    narrow = [passage for passage in topo_map.passages if passage.width <= need]
    for passage in narrow:
        yield MapProblem(
            "narrow", str(passage), f"{passage.width:g} m wide, the robot needs {need:g} m"
        )
    if not narrow:
        return
    wide = topo_map.graph.copy()
    wide.remove_edges_from((passage.a, passage.b) for passage in narrow)
    kept = max(nx.connected_components(wide), key=len)
    for name in topo_map.parts[0]:
        if name not in kept:
            yield MapProblem(
                "unreachable", name, "only edges too narrow for the robot lead to this place"
            )


def _duplicates(topo_map: TopoMap) -> Iterator[MapProblem]:
    places = list(topo_map.places.values())
    for index, place in enumerate(places):
        near = np.nonzero(topo_map.place_distances(place.x, place.y)[:index] < _SAME_POINT)[0]
        for other in near:
            yield MapProblem(
                "duplicate",
                place.name,
                f"at the same point as {places[int(other)].name!r}; remove one of them",
            )


def _places_in_walls(
    topo_map: TopoMap, clearances: Clearances, radius: float
) -> Iterator[MapProblem]:
    places = list(topo_map.places.values())
    free = clearances(np.array([(place.x, place.y) for place in places]))
    for place, clearance in zip(places, free.tolist(), strict=True):
        if clearance < radius:
            near = f"{clearance:.2f} m from an obstacle"
            what = "inside an obstacle" if clearance < 0.0 else near
            yield MapProblem(
                "in-wall", place.name, f"{what}, the robot needs {radius:g} m; move it"
            )


def _blocked_passages(
    topo_map: TopoMap, clearances: Clearances, radius: float
) -> Iterator[MapProblem]:
    for passage in topo_map.passages:
        a, b = topo_map.places[passage.a], topo_map.places[passage.b]
        if passage.length > STRAIGHT * a.distance(b.x, b.y) + _WIDTH_ROUNDING:
            continue
        count = min(2 + int(a.distance(b.x, b.y) / STEP), _MAX_POINTS)
        line = np.linspace((a.x, a.y), (b.x, b.y), count)
        free = clearances(line)
        worst = int(np.argmin(free))
        at = f"at ({line[worst, 0]:.2f}, {line[worst, 1]:.2f})"
        if free[worst] < radius:
            clear = f"has {free[worst]:.2f} m of clearance"
            what = "crosses an obstacle" if free[worst] <= 0.0 else clear
            message = f"{what} {at}, the robot needs {radius:g} m to each side"
            yield MapProblem("blocked", str(passage), message)
        elif math.isfinite(passage.width) and passage.width > 2.0 * free[worst] + _WIDTH_ROUNDING:
            yield MapProblem(
                "width",
                str(passage),
                f"{passage.width:g} m wide in the map, {2.0 * free[worst]:.2f} m in the world {at}",
            )
