"""The topological map: places and passages as a networkx graph, with landmarks (METHOD 4.1).

Lengths in metres, positions in the ``map`` frame (REP-105).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import networkx as nx
import numpy as np

from navfw.assumption import Assumption
from navfw.errors import MapError, UnknownNameError
from navfw.numerics import Array
from navfw.signals.immutability import Sealed
from navfw.topomap.elements import Landmark, Passage, Place, map_violations
from navfw.topomap.occupancy_map import OccupancyMap


@dataclass(frozen=True, slots=True)
class PassageProjection:
    """The projection of a point onto the straight line between a passage's ends.

    ``along`` [m] is the distance of the projected point from place ``a``, ``span`` [m] that between
    the two places, ``aside`` [m] that from the point to its projection.
    """

    passage: Passage
    along: float
    span: float
    aside: float

    @property
    def share(self) -> float:
        """Position of the projected point between the ends: 0 at place ``a``, 1 at the other."""
        return 0.0 if self.span == 0.0 else self.along / self.span

    def to_end(self, place: str) -> float:
        """Return the distance [m] along the passage, scaled to its length, to the end ``place``."""
        share = self.share
        return self.passage.length * (share if place == self.passage.a else 1.0 - share)


class TopoMap(Sealed):
    """An undirected graph of places and passages, with landmarks: the map that a robot is given.

    A map is immutable: closed passages and changed costs are state of the planner. ``floor_plan``
    is the plan of the walls that comes with the map, or None; ``assumed`` what its reader took for
    granted.

    >>> hall, door = Place("hall", 0.0, 0.0), Place("door", 3.0, 0.0, "door")
    >>> office = TopoMap("office", [hall, door], [Passage("hall", "door", 3.0, width=0.9)])
    >>> office.nearest_place(0.2, 0.1).name
    'hall'

    Raises:
        MapError: the map has no place, or violations (``elements``); the message lists all.

    """

    def __init__(
        self,
        name: str,
        places: Iterable[Place],
        passages: Iterable[Passage],
        file: str | Path | None = None,
        landmarks: Iterable[Landmark] = (),
        floor_plan: OccupancyMap | None = None,
        assumed: Iterable[Assumption] = (),
    ) -> None:
        nodes, passages, landmarks = list(places), tuple(passages), tuple(landmarks)
        violations = map_violations(nodes, passages, landmarks)
        if violations:
            raise MapError("; ".join(map(str, violations)), file=file, key=name)
        self.name = name
        self.file = None if file is None else str(file)
        self.places: Mapping[str, Place] = MappingProxyType({p.name: p for p in nodes})
        self.passages = passages
        self.floor_plan = floor_plan
        self.assumed = tuple(assumed)
        self.landmarks: Mapping[str, Landmark] = MappingProxyType({m.name: m for m in landmarks})
        self._graph = nx.Graph(name=name)
        self._graph.add_nodes_from((p.name, {"place": p}) for p in nodes)
        self._graph.add_edges_from((p.a, p.b, {"passage": p, "length": p.length}) for p in passages)
        self._points = np.array([(p.x, p.y) for p in nodes])
        index = {place.name: i for i, place in enumerate(nodes)}
        ends = np.array([(index[p.a], index[p.b]) for p in passages], dtype=np.intp).reshape(-1, 2)
        self._starts = self._points[ends[:, 0]]
        self._legs = self._points[ends[:, 1]] - self._starts
        self._spans = np.hypot(self._legs[:, 0], self._legs[:, 1])
        self._seal()

    def __repr__(self) -> str:
        return f"TopoMap({self.name!r}, {len(self.places)} places, {len(self.passages)} passages)"

    @property
    def all_assumed(self) -> tuple[Assumption, ...]:
        """What was taken for granted of the map and of its floor plan."""
        return self.assumed + (() if self.floor_plan is None else self.floor_plan.assumed)

    def replaced(self, **parts: Any) -> TopoMap:
        """Return the map with other ``parts``, by their names; under another name, of no file."""
        file = None if "name" in parts else self.file
        same = {name: getattr(self, name) for name in ("name", "passages", "floor_plan", "assumed")}
        same |= {"places": self.places.values(), "landmarks": self.landmarks.values()}
        return TopoMap(**{**same, "file": file, **parts})

    def renamed(self, names: Mapping[str, str]) -> TopoMap:
        """Return the map with the places that are keys of ``names`` called as their values."""
        places = [replace(p, name=names.get(p.name, p.name)) for p in self.places.values()]
        ends = [replace(p, a=names.get(p.a, p.a), b=names.get(p.b, p.b)) for p in self.passages]
        return self.replaced(places=places, passages=ends)

    def extended(self, places: Iterable[Place], passages: Iterable[Passage]) -> TopoMap:
        """Return the map with more places and passages."""
        more = [*self.places.values(), *places], [*self.passages, *passages]
        return self.replaced(places=more[0], passages=more[1])

    @property
    def graph(self) -> nx.Graph:
        """A networkx graph of the map, a new one each time, for its algorithms.

        The places' names are its nodes, with the attribute ``place``; edges have ``passage``, and
        its ``length`` [m] for use as a weight.
        """
        return self._graph.copy()

    def place(self, name: str) -> Place:
        """Return the place called ``name``.

        Raises:
            UnknownNameError: the map has none; the message names the nearest one.

        """
        try:
            return self.places[name]
        except KeyError:
            raise UnknownNameError("place", name, self.places, file=self.file) from None

    @functools.cached_property
    def landmarks_by_identity(self) -> Mapping[str, Landmark]:
        """Landmarks by their identity in detections (``aruco-7``)."""
        return MappingProxyType({mark.identity: mark for mark in self.landmarks.values()})

    def passage(self, a: str, b: str) -> Passage:
        """Return the passage between two places, given in either order.

        Raises:
            UnknownNameError: there is no such place.
            MapError: both places exist, but no passage connects them.

        """
        self.place(a)
        self.place(b)
        if not self._graph.has_edge(a, b):
            raise MapError(
                f"there is no passage between {a!r} and {b!r}; those of {a!r} lead to: "
                + (", ".join(self._graph[a]) or "no place"),
                file=self.file,
            )
        passage: Passage = self._graph.edges[a, b]["passage"]
        return passage

    def passages_at(self, place: str) -> tuple[Passage, ...]:
        """Return the passages that end at ``place``, in the order of the map."""
        self.place(place)
        return tuple(data["passage"] for data in self._graph[place].values())

    def door_normal(self, door: Place) -> tuple[float, float] | None:
        """Return the unit direction through a door, by its one or two passages; None if unclear."""
        beyond = [self.places[p.other(door.name)] for p in self.passages_at(door.name)]
        if len(beyond) not in {1, 2}:
            return None
        start = beyond[1] if len(beyond) == 2 else door
        dx, dy = beyond[0].x - start.x, beyond[0].y - start.y
        length = math.hypot(dx, dy)
        return None if length == 0.0 else (dx / length, dy / length)

    @functools.cached_property
    def parts(self) -> tuple[frozenset[str], ...]:
        """Connected parts of the map as sets of place names, largest first."""
        parts = [frozenset(names) for names in nx.connected_components(self._graph)]
        return tuple(sorted(parts, key=len, reverse=True))

    def part_of(self, place: str) -> frozenset[str]:
        """Return the names of all places connected with ``place``, itself included."""
        self.place(place)
        return next(part for part in self.parts if place in part)

    @functools.cached_property
    def isolated(self) -> frozenset[str]:
        """Names of the places without passages."""
        return frozenset(nx.isolates(self._graph))

    def place_distances(self, x: float, y: float) -> Array:
        """Return straight distances (places,) [m] from (x, y) to all places, in the map's order."""
        return np.hypot(self._points[:, 0] - x, self._points[:, 1] - y)

    def nearest_place(self, x: float, y: float) -> Place:
        """Return the place nearest to (x, y) [m, map] in a straight line, regardless of walls."""
        return list(self.places.values())[int(np.argmin(self.place_distances(x, y)))]

    def nearest_passage(self, x: float, y: float) -> PassageProjection | None:
        """Project (x, y) [m] onto the nearest passage; None in a map without passages."""
        projections = self.project_onto_passages(x, y, slack=0.0)
        return projections[0] if projections else None

    def project_onto_passages(
        self, x: float, y: float, slack: float, among: Sequence[Passage] | None = None
    ) -> list[PassageProjection]:
        """Project onto the nearest passage and those up to ``slack`` [m] farther, by distance.

        ``among`` restricts the choice to some of the map's passages.
        """
        if not self.passages or (among is not None and not among):
            return []
        along, aside = self._project(x, y)
        candidates = np.arange(len(aside))
        if among is not None:
            candidates = np.array([self._passage_index[passage.ends] for passage in among])
        reach = float(np.min(aside[candidates])) + slack
        near = candidates[aside[candidates] <= reach]
        near = near[np.argsort(aside[near], kind="stable")]
        return [
            PassageProjection(
                self.passages[i], float(along[i]), float(self._spans[i]), float(aside[i])
            )
            for i in near
        ]

    def _project(self, x: float, y: float) -> tuple[Array, Array]:
        """Project onto all passages: distances along and aside, (passages,) [m] each.

        A passage between two places at the same point has its projection at the first.
        """
        offset = np.array((x, y)) - self._starts
        safe = np.where(self._spans > 0.0, self._spans, 1.0)
        along = np.clip(np.sum(offset * self._legs, axis=1) / safe, 0.0, self._spans)
        foot = self._legs * (along / safe)[:, None]
        return along, np.hypot(offset[:, 0] - foot[:, 0], offset[:, 1] - foot[:, 1])

    @functools.cached_property
    def _passage_index(self) -> dict[frozenset[str], int]:
        return {passage.ends: i for i, passage in enumerate(self.passages)}
