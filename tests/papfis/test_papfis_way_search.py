"""The search for another way, over what was seen and what was not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navfw.papfis.papfis import Papfis
from navfw.robot import RobotModel
from navfw.signals import Belief, GrownGrid, PassageReport, PassageStatus, Pose, Waypoint
from navfw.topomap import Passage, Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

CELL = 0.05
WEST, DOOR, EAST = Place("west", 2.0, 3.0), Place("door", 4.0, 3.0, "door"), Place("east", 6.0, 3.0)
PASSAGES = [Passage("west", "door", 2.0, 1.0), Passage("door", "east", 2.0, 1.0)]


def two_rooms(door: tuple[float, float], value: float) -> np.ndarray:
    """Rooms of 4 x 6 m side by side, with a door from ``door[0]`` to ``door[1]`` [m] up."""
    cells = np.full((120, 160), value)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 1.0, 1.0, 1.0, 1.0
    cells[:, 79:82] = 1.0
    cells[round(door[0] / CELL) : round(door[1] / CELL), 79:82] = value
    return cells


class Robot:
    """Drives to each waypoint at 0.5 m/s in a world, and sees 1.5 m around itself."""

    def __init__(self, world: np.ndarray, plan: bool) -> None:
        known = two_rooms((2.5, 3.5), 0.0)
        cells = np.where(known > 0.5, OCCUPIED, FREE).astype(np.int8)
        floor = OccupancyMap(cells, CELL, Pose(0.0, 0.0, 0.0)) if plan else None
        self.planner = Papfis(RobotModel())
        self.topo_map = TopoMap("two", [WEST, DOOR, EAST], PASSAGES, floor_plan=floor)
        goal = Waypoint.goal(6.0, 3.0, 0.3, "east")
        self.planner.start(self.topo_map, [replace(goal, place="east")])
        self.world, self.seen = world, np.zeros(world.shape, np.int8)
        self.at, self.time = np.array([3.0, 3.0]), 0.0

    def drive(self, seconds: float) -> bool:
        """Return whether the goal was reached."""
        y, x = np.ogrid[: self.world.shape[0], : self.world.shape[1]]
        for _ in range(round(seconds / 0.5)):
            self.time += 0.5
            near = np.hypot(CELL * x - self.at[0], CELL * y - self.at[1]) < 1.5
            self.seen[near] = np.where(self.world[near] > 0.5, 96, -40)
            if self.planner.wants_grid:
                self.planner.observe_grid(GrownGrid(self.seen.copy(), (0.0, 0.0), CELL))
            queries = [q for q in self.planner.queries if "door" in q.passage]
            status: PassageStatus = "closed"
            reported = tuple((query, status) for query in queries[:1])
            self.planner.observe(PassageReport(self.time, reported))
            pose = Pose(float(self.at[0]), float(self.at[1]), 0.0)
            waypoint = self.planner.update(Belief(self.time, pose, np.eye(3) * 1e-4, {}, 1.0))
            if waypoint is None:
                return True
            step = np.array([waypoint.x, waypoint.y]) - self.at
            moved = self.at + step * min(1.0, 0.25 / max(float(np.hypot(*step)), 1e-9))
            row, column = np.rint(moved[::-1] / CELL).astype(int)
            if self.world[row - 3 : row + 4, column - 3 : column + 4].max() < 0.5:
                self.at = moved
        return False


def test_a_door_that_the_map_has_not_is_found_and_becomes_a_passage() -> None:
    for plan in (True, False):
        robot = Robot(two_rooms((0.8, 1.7), 0.0), plan)
        assert robot.drive(60.0), plan
        assert "found a way from" in robot.planner.notes
        tour = robot.planner._tour
        assert tour is not None
        found = [place for name, place in tour.router.topo_map.places.items() if "found" in name]
        assert any(abs(place.x - 4.0) < 1.0 and 0.8 < place.y < 1.7 for place in found)


def test_a_room_without_another_door_is_given_up_with_the_closed_passage() -> None:
    robot = Robot(two_rooms((0.0, 0.0), 0.0), plan=True)
    assert not robot.drive(55.0)
    assert robot.planner.no_route_reason == "the only route to east is closed: door - east"
    assert robot.planner.notes == ""
    assert (robot.seen[:, 79] > 0).all()  # it looked along the whole wall
