"""Places, passages and landmarks, and the map that holds them as a networkx graph.

Lengths in metres, positions in the ``map`` frame (REP-105). Source: METHOD 4.1.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import networkx as nx
import numpy as np

from navfw.errors import MapError, UnknownNameError
from navfw.signals import Array
from navfw.topomap.elements import Landmark, Passage, Place
from navfw.topomap.validation import map_violations

__all__ = ["PassageProjection", "TopoMap"]


@dataclass(frozen=True, slots=True)
class PassageProjection:
    """Where a point stands beside a passage.

    ``along`` [m] is the foot's distance from place ``a`` on the straight line to ``b`` (whose
    length is ``span`` [m]), ``aside`` [m] the point's distance from that foot.
    """

    passage: Passage
    along: float
    span: float
    aside: float

    def to_end(self, place: str) -> float:
        """Distance [m] from the foot to that end of the passage, in the passage's own length."""
        share = 0.0 if self.span == 0.0 else self.along / self.span
        return self.passage.length * (share if place == self.passage.a else 1.0 - share)


class TopoMap:
    """An undirected topological map over a networkx graph.

    ``graph`` has the places' names as nodes, with the attribute ``place``, and the attribute
    ``passage`` on its edges. A map is not changed once built: what a planner learns on the way
    stays in the planner.

    >>> hall, door = Place("hall", 0.0, 0.0), Place("door", 3.0, 0.0, "door")
    >>> office = TopoMap("office", [hall, door], [Passage("hall", "door", 3.0, width=0.9)])
    >>> office.nearest_place(0.2, 0.1).name
    'hall'

    Raises:
        MapError: the map has no place or contradicts itself; every contradiction is listed.

    """

    def __init__(
        self,
        name: str,
        places: Iterable[Place],
        passages: Iterable[Passage],
        file: str | Path | None = None,
        landmarks: Iterable[Landmark] = (),
    ) -> None:
        listed, passages, landmarks = list(places), tuple(passages), tuple(landmarks)
        found = map_violations(listed, passages, landmarks)
        if found:
            raise MapError("; ".join(map(str, found)), file=file, key=name)
        self.name = name
        self.file = None if file is None else str(file)
        self.places: Mapping[str, Place] = MappingProxyType({p.name: p for p in listed})
        self.passages = passages
        self.landmarks: Mapping[str, Landmark] = MappingProxyType({m.name: m for m in landmarks})
        self.graph = nx.Graph(name=name)
        self.graph.add_nodes_from((p.name, {"place": p}) for p in listed)
        self.graph.add_edges_from((p.a, p.b, {"passage": p}) for p in passages)
        self._points = np.array([(p.x, p.y) for p in listed])
        index = {place.name: i for i, place in enumerate(listed)}
        ends = np.array([(index[p.a], index[p.b]) for p in passages], dtype=np.intp).reshape(-1, 2)
        self._starts = self._points[ends[:, 0]]
        self._legs = self._points[ends[:, 1]] - self._starts
        self._spans = np.hypot(self._legs[:, 0], self._legs[:, 1])

    def __repr__(self) -> str:
        return f"TopoMap({self.name!r}, {len(self.places)} places, {len(self.passages)} passages)"

    def place(self, name: str) -> Place:
        """The place of that name.

        Raises:
            UnknownNameError: the map has none; the message says which name is near.

        """
        try:
            return self.places[name]
        except KeyError:
            raise UnknownNameError("place", name, self.places, file=self.file) from None

    @functools.cached_property
    def landmarks_by_identity(self) -> Mapping[str, Landmark]:
        """The landmarks by what detections call them (``aruco-7``)."""
        return MappingProxyType({mark.identity: mark for mark in self.landmarks.values()})

    def passage(self, a: str, b: str) -> Passage:
        """The passage between two places, whichever way it is listed.

        Raises:
            UnknownNameError: there is no such place.
            MapError: there are both places, but no passage between them.

        """
        self.place(a)
        self.place(b)
        if not self.graph.has_edge(a, b):
            raise MapError(
                f"there is no passage between {a!r} and {b!r}; from {a!r} lead: "
                + (", ".join(self.graph[a]) or "none"),
                file=self.file,
            )
        passage: Passage = self.graph.edges[a, b]["passage"]
        return passage

    def passages_at(self, place: str) -> tuple[Passage, ...]:
        """The passages that end at ``place``, in the order of the map."""
        self.place(place)
        return tuple(data["passage"] for data in self.graph[place].values())

    @functools.cached_property
    def parts(self) -> tuple[frozenset[str], ...]:
        """The map's connected parts as sets of place names, largest first."""
        found = [frozenset(part) for part in nx.connected_components(self.graph)]
        return tuple(sorted(found, key=len, reverse=True))

    def part_of(self, place: str) -> frozenset[str]:
        """All places that can be reached from ``place``, itself among them."""
        self.place(place)
        return self._part_by_place[place]

    @functools.cached_property
    def isolated(self) -> frozenset[str]:
        """The places that no passage touches."""
        return frozenset(nx.isolates(self.graph))

    @functools.cached_property
    def _part_by_place(self) -> dict[str, frozenset[str]]:
        return {place: part for part in self.parts for place in part}

    def place_distances(self, x: float, y: float) -> Array:
        """(places,) straight distances [m] from the point to all places, in the map's order."""
        return np.hypot(self._points[:, 0] - x, self._points[:, 1] - y)

    def nearest_place(self, x: float, y: float) -> Place:
        """The place at the smallest straight distance, walls or not."""
        return list(self.places.values())[int(np.argmin(self.place_distances(x, y)))]

    def nearest_passage(self, x: float, y: float) -> PassageProjection | None:
        """The passage nearest to the point, or None in a map without passages."""
        found = self.project_onto_passages(x, y, slack=0.0)
        return found[0] if found else None

    def project_onto_passages(
        self, x: float, y: float, slack: float, among: Sequence[Passage] | None = None
    ) -> list[PassageProjection]:
        """The nearest passage and those at most ``slack`` [m] farther, nearest first.

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
        """For every passage the foot's distance from its start and the point's from the foot."""
        offset = np.array((x, y)) - self._starts
        # two places at one spot make a passage of no extent: its foot is its start
        safe = np.where(self._spans > 0.0, self._spans, 1.0)
        along = np.clip(np.sum(offset * self._legs, axis=1) / safe, 0.0, self._spans)
        foot = self._legs * (along / safe)[:, None]
        return along, np.hypot(offset[:, 0] - foot[:, 0], offset[:, 1] - foot[:, 1])

    @functools.cached_property
    def _passage_index(self) -> dict[frozenset[str], int]:
        return {passage.ends: i for i, passage in enumerate(self.passages)}
