"""A full turn at any place of the hospital shows a marker."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from navfw.config import find
from navfw.features import Aruco
from navfw.missions import start_candidates
from navfw.robot import RobotModel
from navfw.signals import Frame, Pose
from navfw.sim import SensorParams, Simulation, load_world
from navfw.topomap import Place, TopoMap, load_map

VIEWS = 12


@pytest.fixture(scope="module")
def hospital() -> TopoMap:
    return load_map(find("map", "hospital"))


@pytest.fixture(scope="module")
def simulation(hospital: TopoMap) -> Iterator[Simulation]:
    robot = RobotModel()
    camera = robot.model_copy(update={"camera": robot.landmark_view})
    start = hospital.places["lab"]
    world = load_world(find("world", "hospital"))
    perfect = SensorParams.preset("perfect")
    with Simulation(world, camera, Pose(start.x, start.y, 0.0), 0, perfect) as running:
        yield running


def seen_around(simulation: Simulation, hospital: TopoMap, place: Place) -> set[str]:
    """The markers of the map that are detected in a full turn at ``place``."""
    recognizer = Aruco(RobotModel())
    recognizer.set_map(hospital)
    found: set[str] = set()
    for view in range(VIEWS):
        yaw = view * 2.0 * math.pi / VIEWS
        image, _ = simulation.render_from(Pose(place.x, place.y, yaw))
        found |= {detection.identity for detection in recognizer.recognize(Frame(0.0, image))}
    return found & hospital.landmarks_by_identity.keys()


@pytest.mark.parametrize(
    ("name", "number"), [("pharmacy-east", 81), ("kitchen-west", 82), ("kitchen-west", 83)]
)
def test_corners_behind_furniture_have_markers(
    simulation: Simulation, hospital: TopoMap, name: str, number: int
) -> None:
    assert f"aruco-{number}" in seen_around(simulation, hospital, hospital.places[name])


@pytest.mark.slow
def test_a_marker_is_detected_from_every_start_place(
    simulation: Simulation, hospital: TopoMap
) -> None:
    places = start_candidates(hospital, [])
    blind = [p.name for p in places if not seen_around(simulation, hospital, p)]
    assert blind == []
