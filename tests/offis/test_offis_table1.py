"""All sixteen cells of the paper's Table 1, as METHOD R11 reconstructs it."""

from __future__ import annotations

import numpy as np
import pytest
from offis_scenes import Scene, ideal_flow, wall_ahead

from navfw.offis import TABLE, Offis, infer, load_system
from navfw.robot import RobotModel
from navfw.signals import Twist

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
        percept = Offis(RobotModel()).perceive(flow, Twist(speed, 0.0))
        assert set(percept.obstacles["layer1"].values()) == {term}
