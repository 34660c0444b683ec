"""Images without information: the percept is unknown, with low confidence."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from navfw.egomotion import refine
from navfw.flow import BlockMatching
from navfw.numerics import Image
from navfw.offis import Offis
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame, FramePair, Label, Percept, Twist

ROBOT = RobotModel()
AHEAD = CameraMotion(np.eye(3), np.array([0.0, 0.0, 0.07]), 0.2, 0.001, 0.002)
UNKNOWN = "Layer1: nearest object is unknown; Layer2: nearest object is unknown; Front is unknown"


def percept_of(
    past: Image, now: Image, motion: CameraMotion = AHEAD, params: Offis.Params | None = None
) -> Percept:
    raw = BlockMatching(ROBOT).compute(FramePair(Frame(0.0, past), Frame(0.2, now), motion))
    flow = refine(raw, ROBOT.camera).apply(raw, ROBOT.camera)
    return Offis(ROBOT, params).perceive(flow, Twist(0.3, 0.0))


def flat(level: float, noise: float, seed: int) -> Image:
    rng = np.random.default_rng(seed)
    image = level + rng.normal(0.0, noise, (120, 160))
    return np.asarray(np.clip(np.rint(image), 0, 255), dtype=np.uint8)


@pytest.mark.parametrize("mode", ["nearness", "paper"])
@pytest.mark.parametrize(
    ("level", "noise"), [(0, 0.0), (0, 2.0), (128, 0.0), (128, 1.0), (255, 0.0)]
)
def test_black_white_and_textureless_images_are_unknown(
    level: float, noise: float, mode: Literal["nearness", "paper"]
) -> None:
    params = Offis.Params(mode=mode)
    percept = percept_of(flat(level, noise, 1), flat(level, noise, 2), params=params)
    assert (percept.label == Label.UNKNOWN).all()
    assert percept.confidence.max() < 0.15
    assert percept.situations["unknown"] > 0.9
    assert max(d for name, d in percept.situations.items() if name != "unknown") < 0.1
    assert percept.floor_in_front < 0.5
    assert percept.sentence == UNKNOWN
    assert not any(any(degrees.values()) for degrees in percept.quadrants.values())


def test_a_frame_that_has_nothing_to_do_with_the_last_is_not_sure_of_floor_or_wall() -> None:
    rng = np.random.default_rng(4)
    past, now = (rng.integers(0, 255, (120, 160)).astype(np.uint8) for _ in range(2))
    percept = percept_of(past, now)
    assert percept.floor_in_front < 0.5
    assert (percept.confidence > 0.5).mean() < 0.1


def test_an_image_that_stands_still_while_the_robot_drives_is_no_wall_ahead() -> None:
    rng = np.random.default_rng(5)
    image = np.kron(rng.integers(60, 200, (30, 40)), np.ones((4, 4))).astype(np.uint8)
    percept = percept_of(image, image)
    # zero flow: everything is infinitely far, or the lens is covered
    assert percept.sentence.startswith(
        ("Layer1: no object in sight", "Layer1: nearest object is unknown")
    )
    assert "near" not in {t for regions in percept.obstacles.values() for t in regions.values()}


def test_without_translation_a_textured_image_is_unknown() -> None:
    rng = np.random.default_rng(6)
    image = np.kron(rng.integers(60, 200, (30, 40)), np.ones((4, 4))).astype(np.uint8)
    still = CameraMotion(np.eye(3), np.zeros(3), 0.2, 0.001, 0.002)
    assert percept_of(image, image, still).sentence == UNKNOWN
