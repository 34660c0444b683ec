"""Images without information, and all sixteen cells of the paper's Table 1 (METHOD R11)."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from offis_scenes import Scene, ideal_flow, wall_ahead

from navfw.egomotion import refine
from navfw.flow import BlockMatching
from navfw.numerics import Image
from navfw.offis import TABLE, Offis, infer, load_system
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


# --- Table 1 ---


SLOPES = {"very slope": 2.0, "slope": 1.0, "orthogonal": 0.0, "unusual": -1.0}

# rows: left plane, columns: right plane, both very slope, slope, orthogonal, unusual
CELLS = """
door or corridor | door or corner | door or corner | door or unknown
door or corner | door or corner | corner | left slope wall or unknown
door or corner | corner | wall | left wall or unknown
door or unknown | right slope wall or unknown | right wall or unknown | unknown
"""
TABLE_1 = {
    (left, right): cell.strip()
    for left, line in zip(SLOPES, CELLS.strip().splitlines(), strict=True)
    for right, cell in zip(SLOPES, line.split("|"), strict=True)
}


def degrees(left: float, right: float) -> dict[str, float]:
    found = infer(load_system("situation"), {"left": np.array([left]), "right": np.array([right])})
    return {name: float(found.degree("situation", name.replace(" ", "_"))[0]) for name in TABLE}


@pytest.mark.parametrize("cell", TABLE_1, ids=" and ".join)
def test_every_cell_is_concluded_fully_and_alone(cell: tuple[str, str]) -> None:
    found = degrees(*(SLOPES[side] for side in cell))
    assert found.pop(TABLE_1[cell]) == pytest.approx(1.0)
    assert max(found.values()) == pytest.approx(0.0)


@pytest.mark.parametrize("unusual", [-1.0, -2.0])
def test_both_unusual_codes_are_unusual(unusual: float) -> None:
    assert degrees(unusual, unusual)["unknown"] == pytest.approx(1.0)


def test_between_two_cells_both_hold_in_part() -> None:
    found = degrees(1.5, 2.0)
    assert found["door or corridor"] == pytest.approx(0.5)
    assert found["door or corner"] == pytest.approx(0.5)


@pytest.mark.parametrize("speed", [0.0, float("nan"), -0.2])
def test_without_a_forward_speed_distance_alone_decides(speed: float) -> None:
    for distance, term in ((0.6, "near"), (1.5, "middle"), (3.5, "far")):
        flow, _ = ideal_flow(Scene((wall_ahead(distance),)))
        percept = Offis(ROBOT).perceive(flow, Twist(speed, 0.0))
        assert set(percept.obstacles["layer1"].values()) == {term}
