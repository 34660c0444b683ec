"""Probabilities of what stands in front, on scenes whose flow is exact."""

from collections.abc import Iterable
from typing import Any

import pytest
from offis_scenes import Scene, Wall, corner, corridor, ideal_flow, wall_ahead

from navfw.offis import Offis
from navfw.perceive.pair_motion import ScaleEstimator
from navfw.perceive.sentence_evidence import front_probabilities, probable_front
from navfw.robot import RobotModel
from navfw.signals import Percept, Twist

ROBOT = RobotModel()
CAMERA = ROBOT.camera


def percept_of(walls: Iterable[Wall], **options: Any) -> Percept:
    flow, _ = ideal_flow(Scene(tuple(walls)), **options)
    return Offis(ROBOT).perceive(flow, Twist(0.3, 0.0))


@pytest.mark.parametrize(
    ("walls", "front"),
    [
        (corridor(), "corridor"),
        (corner(1.2), "corner"),
        ([wall_ahead(1.0)], "wall"),
        ([wall_ahead(15.0)], "open"),
    ],
)
def test_the_front_by_heights_of_the_camera(walls: Iterable[Wall], front: str) -> None:
    found = front_probabilities(percept_of(walls), CAMERA, CAMERA.mount_height, CAMERA.pitch)
    assert sum(found.values()) == pytest.approx(1.0)
    assert probable_front(found) == front
    # as if all were ten times as far away, in heights of the camera
    far = front_probabilities(percept_of(walls), CAMERA, 0.1 * CAMERA.mount_height, CAMERA.pitch)
    assert far["open"] >= found.get("open", 0.0)


def test_without_a_floor_only_one_plane_is_a_wall() -> None:
    unknown = ScaleEstimator(None, None).update(None).height

    def front(walls: Iterable[Wall]) -> str:
        seen = percept_of(walls)
        return probable_front(front_probabilities(seen, CAMERA, unknown, 0.0))

    assert front([wall_ahead(1.0)]) == "wall"
    assert front(corridor()) == "unknown"


def test_what_is_not_probable_enough_is_unknown() -> None:
    assert probable_front({}) == "unknown"
    assert probable_front({"open": 0.5, "corridor": 0.1, "wall": 0.3, "other": 0.1}) == "unknown"
    assert probable_front({"wall": 0.3, "other": 0.7}) == "unknown"
