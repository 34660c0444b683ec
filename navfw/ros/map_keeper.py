"""Publish the map that grows while the robot drives, and save it; ``now`` are stamps [ns]."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from navfw.errors import ConfigError, InputError, MapError
from navfw.mapping import GrowingMap, made_map, with_place
from navfw.mapping.evidence_grid import KeyPose
from navfw.mapping.joining import JoinedMap, free_names, join_all, key_at
from navfw.mapping.matching import plan_of
from navfw.recording import ros_message
from navfw.recording.ros_messages import pose_fields, time_fields
from navfw.ros.connection import RosNode
from navfw.ros.drive_outputs import grid_message
from navfw.signals import GrownGrid, Odometry, Pose
from navfw.stack import MappingStack, Stack
from navfw.topomap import TopoMap
from navfw.topomap.map_formats import save_map
from navfw.topomap.occupancy_map import Cells

NAME_PLACE = "name_place"
"""Topic of names for the place where the robot is."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
_MARKERS = "visualization_msgs/msg/MarkerArray"
_TOPICS = {
    "navfw/map": "nav_msgs/msg/OccupancyGrid",
    "navfw/frontiers": _MARKERS,
    "navfw/graph": _MARKERS,
}
_PERIOD = 10**9
"""Least time [ns] between two grids that are published."""
_REST = 9.0
"""Least time between two maps that are made, divided by the time that the former took: making maps
then takes a tenth of a core at most, and in a large building some key poses are left out."""
_LINES, _SPHERES, _TEXT, _DELETE_ALL = 5, 7, 9, 3
"""Types of markers, and the action that removes earlier ones."""
_SIZE = 0.2
"""Diameter of spheres and height of letters [m]; lines are a fifth as wide."""
_PLACES, _AHEAD, _OPEN, _GIVEN_UP = (0.1, 0.4, 0.9), (0.1, 0.8, 0.2), (0.9, 0.7, 0.1), (0.5,) * 3
"""Colours (r, g, b) of the graph, and of frontiers: the one pursued, others, those given up."""
_Points = Iterable[tuple[float, float]]
_Places = Mapping[str, Pose]


class MapKeeper:
    """Publishes the map that ``stack`` grows on ``node``, and saves it in ``file``, if not None.

    After each key pose a thread makes the topological map, as soon as the last one is made: a node
    that is killed leaves it. A name that comes on ``name_place`` is given to the place where the
    robot is then. Each part of a drive that was split has a file of its own until ``finish`` joins
    parts that overlap.

    Raises:
        ConfigError: the map is not the one that ``stack`` drives on.

    """

    def __init__(self, node: RosNode, stack: Stack, file: Path | None) -> None:
        if not stack.resolved.settings.growing_map:
            what = "expected a stack with growing_map: true, such as explore, or base: explore"
            raise ConfigError(what, key="--stack")
        self._node, self._stack = node, stack
        self._files = [file]
        self._named: dict[str, tuple[int, Odometry]] = {}
        self._told = -_PERIOD
        self._shown: Cells = np.empty((0, 0), np.int8)
        self._maker, self._keys, self._due = threading.Thread(), (0, 0), 0.0
        self._made: TopoMap | None = None
        self._publish = {
            topic: node.publisher(topic, kind, "latched") for topic, kind in _TOPICS.items()
        }
        node.subscribe(NAME_PLACE, "std_msgs/msg/String", self._take_name, "reliable")

    @property
    def _growing(self) -> GrowingMap:
        return self._stack.growth.growing_map

    def _maps(self) -> Sequence[GrowingMap]:
        """Return the maps of the parts of the drive so far."""
        parts = self._stack.parts if isinstance(self._stack, MappingStack) else ()
        return [part.growing for part in parts] or [self._growing]

    def _take_name(self, message: Any) -> None:
        name, odometry = str(message.data), self._stack.state.odometry
        if not _NAME.fullmatch(name) or odometry is None:
            why = "nothing was seen yet" if odometry is None else "expected letters and digits"
            self._node.note(f"the name {name!r:.40} on {NAME_PLACE} is left out: {why}")
            return
        self._named[name] = len(self._maps()) - 1, odometry
        pose = self._growing.pose
        self._node.say(f"{name} is at ({pose.x:.2f}, {pose.y:.2f})")

    def tell(self, now: int) -> None:
        """Publish changes, and save the map; to be called after each frame, at ``now`` [ns]."""
        number = len(self._maps()) - 1
        if number == len(self._files):
            self._begin_file(number)
        keys = number, len(self._growing.keys)
        if keys[1] and keys != self._keys and time.monotonic() >= self._due:
            self._due, self._keys = float("inf"), keys
            places = self._places({number: self._growing.keys})
            parts = self._files[number], self._growing.grid, self._growing.drops, places
            self._maker = threading.Thread(target=self._make, args=parts)
            self._maker.start()
        if self._growing.begun and not 0 <= now - self._told < _PERIOD:
            self._told = now
            self._tell(now)

    def _tell(self, now: int) -> None:
        plan, send = plan_of(self._growing.grid), self._publish
        if not np.array_equal(plan.cells, self._shown):
            self._shown = plan.cells
            send["navfw/map"](grid_message("map", plan.cells, plan.resolution, plan.origin, now))
        if self._node.wanted("navfw/frontiers"):
            with self._stack.guard.watchdog.on_duty():
                choice = self._stack.planner.explain_choice()
            send["navfw/frontiers"](frontiers_message(choice, now))
        made, self._made = self._made, None
        if made is not None:
            send["navfw/graph"](graph_message(made, now))

    def _begin_file(self, number: int) -> None:
        """Choose the file of another part of the drive."""
        first = self._files[0]
        names = free_names("map" if first is None else first.stem, self._is_taken)
        name = next(islice(names, number, None))
        self._files.append(None if first is None else first.with_stem(name))
        why = self._stack.parts[number - 1].why if isinstance(self._stack, MappingStack) else ""
        self._node.say(f"the drive is split: {why}; from here on the map is {name}")

    def _is_taken(self, name: str) -> bool:
        file = None if self._files[0] is None else self._files[0].with_stem(name)
        return file is not None and file not in self._files and file.exists()

    def _places(self, parts: Mapping[int, Sequence[KeyPose]]) -> _Places:
        """Return the poses of named places, as the map of these parts has been corrected."""
        return {
            name: key_at(parts[number], odometry.time).correction.compose(odometry.pose)
            for name, (number, odometry) in self._named.items()
            if number in parts
        }

    def _make(self, file: Path | None, grid: GrownGrid, drops: Any, places: _Places) -> None:
        """Make and save the map, in a thread beside the drive."""
        began = time.monotonic()
        try:
            self._save(file, grid, drops, places)
        except MapError:
            pass  # no ground is free yet
        except InputError as error:
            self._node.note(f"the map is not saved: {error}")
        now = time.monotonic()
        self._due = now + _REST * (now - began)

    def _save(self, file: Path | None, grid: GrownGrid, drops: Any, places: _Places) -> TopoMap:
        radius = self._stack.robot.radius
        made = made_map("map" if file is None else file.stem, grid, radius, drops)
        for place, pose in places.items():
            try:
                made = with_place(made, place, pose, radius)
            except InputError as error:
                self._node.note(f"{place} is not on the map: {error}")
        if file is not None:
            save_map(made, file)
        self._made = made
        return made

    def finish(self) -> Mapping[str, Any]:
        """Join parts that overlap, save and publish the maps; return data to report about them.

        Raises:
            InputError: nothing was observed, or a file cannot be written.

        """
        if self._maker.ident is not None:
            self._maker.join()
        self._growing.finish()
        maps, said = self._maps(), list[dict[str, Any]]()
        if not any(growing.keys for growing in maps):
            raise InputError("nothing was observed, so there is no map")
        for number in range(len(self._files), len(maps)):
            self._begin_file(number)
        all_joined = join_all(maps) or [JoinedMap.of(0, maps[0])]
        for number in {*range(len(maps))}.difference(*(joined.spans for joined in all_joined)):
            self._node.note(f"part {number + 1} of the drive is in no map: it is too short")
        for joined in all_joined:
            file = self._files[len(said)]
            places = self._places({number: joined.keys(number) for number in joined.spans})
            with suppress(*[MapError] if len(all_joined) > 1 else []):  # no ground is free
                made = self._save(file, joined.growing.grid, joined.growing.drops, places)
                where = None if file is None else str(file)
                size = {"places": len(made.places), "edges": len(made.passages)}
                said.append({"map": where, **size})
        for file in filter(None, self._files[len(said) :]):  # of parts that were joined
            for written in (file, *file.parent.glob(f"plans/{file.stem}.*")):
                written.unlink(missing_ok=True)
        self._tell(self._node.now())
        return {**said[0], "more_maps": said[1:]}


def frontiers_message(choice: Mapping[str, Any], now: int) -> bytes:
    """Encode ``MarkerArray`` of the frontiers in ``explain_choice``, stamped ``now`` [ns]."""
    groups = (
        ([choice] if "x" in choice else (), _AHEAD),
        (choice.get("others", ()), _OPEN),
        (choice.get("given_up", ()), _GIVEN_UP),
    )
    spheres = [
        _list(_SPHERES, [(f["x"], f["y"]) for f in frontiers], colour)
        for frontiers, colour in groups
    ]
    return _markers(spheres, now)


def graph_message(topo_map: TopoMap, now: int) -> bytes:
    """Encode ``MarkerArray`` of places with names, and of passages, stamped ``now`` [ns]."""
    places = topo_map.places
    ends = [places[end] for passage in topo_map.passages for end in passage.ends]
    lines = _list(_LINES, [(place.x, place.y) for place in ends], _PLACES)
    spheres = _list(_SPHERES, [(place.x, place.y) for place in places.values()], _PLACES)
    names = [
        {
            "type": _TEXT,
            "pose": {"position": {"x": place.x, "y": place.y, "z": _SIZE}},
            "scale": {"z": _SIZE},
            "color": _color(_PLACES),
            "text": place.name,
        }
        for place in places.values()
    ]
    return _markers([lines, spheres, *names], now)


def _markers(markers: Sequence[Mapping[str, Any]], now: int) -> bytes:
    """Encode ``MarkerArray`` in ``map``, which replaces the last one."""
    header = {"frame_id": "map", "stamp": time_fields(now)}
    shown = [{"action": _DELETE_ALL}, *(marker for marker in markers if marker)]
    common = {"header": header, "ns": "navfw", "pose": pose_fields(0.0, 0.0, 0.0)}
    made = [{**common, "id": number, **marker} for number, marker in enumerate(shown)]
    return ros_message(_MARKERS, {"markers": made})


def _list(kind: int, points: _Points, colour: Sequence[float]) -> Mapping[str, Any]:
    """Return a marker of spheres, or of lines between pairs of points; {} without points."""
    at = [{"x": x, "y": y} for x, y in points]
    size = _SIZE if kind == _SPHERES else 0.2 * _SIZE
    scale = dict.fromkeys("xyz", size)
    return {"type": kind, "scale": scale, "color": _color(colour), "points": at} if at else {}


def _color(colour: Sequence[float]) -> Mapping[str, float]:
    return dict(zip("rgba", (*colour, 1.0), strict=True))
