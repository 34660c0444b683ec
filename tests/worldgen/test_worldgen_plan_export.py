"""Export of floor plans: the same free ground after import, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from navfw.cli import app
from navfw.sim import SceneGeometry, load_world
from navfw.topomap import load_ros_map
from navfw.worldgen import PlanCleaning, exported_plan, import_plan

ROOT = Path(__file__).parents[2]
WORLDS = ROOT / "worlds"


@pytest.mark.parametrize("name", ["office", "paper-room"])
def test_a_world_exported_and_imported_has_the_same_free_ground(name: str) -> None:
    plan = exported_plan(load_world(WORLDS / name / "world.yaml"))
    made = import_plan(plan, name, PlanCleaning(speckle=0.0, gap=0.0))
    ground = made.topo_map.floor_plan
    assert ground is not None
    # at the centres of the same cells: a second grid would have another origin
    at = plan.centres(*np.nonzero(np.ones(plan.cells.shape, np.bool_)))
    clearance = SceneGeometry.from_world(made.world).clearances(at).reshape(plan.cells.shape)
    inside = cv2.distanceTransform(ground.free.astype(np.uint8), cv2.DIST_L2, 5)
    assert inside[ground.free & (clearance < 0.0)].max(initial=0.0) < 2.0
    # what was solid beside free ground is solid, or within a cell, diagonally at most
    solid = _beside(ground.free) & ~ground.free
    assert clearance[solid].max() < 1.5 * plan.resolution


def _beside(free: np.ndarray) -> np.ndarray:
    """Free ground and the cells around it; farther behind a wall there may be nothing."""
    return cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0


def test_walls_only_leaves_out_furniture() -> None:
    world = load_world(WORLDS / "office" / "world.yaml")
    all_, walls = exported_plan(world), exported_plan(world, walls_only=True)
    assert walls.occupied.sum() < all_.occupied.sum()
    assert not (walls.occupied & ~all_.occupied).any()
    box = world.boxes[0]
    assert all_.state(np.array([box.at])).tolist() == [100]
    assert walls.state(np.array([box.at])).tolist() == [0]


def test_the_command(tmp_path: Path) -> None:
    out = tmp_path / "plan.yaml"
    command = ["map", "export", "paper-room", "--out"]
    result = CliRunner().invoke(app, [*command, str(out), "--resolution", "0.1", "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["cells"] == [90, 50]
    assert load_ros_map(out).resolution == 0.1
    assert (tmp_path / "plan.pgm").read_bytes().startswith(b"P5")
    for options, message in (
        ([str(out), "--resolution", "0.0015"], "choose a larger resolution"),
        ([str(out), "--resolution", "0"], "expected 0.001 to 10 m"),
        ([str(out), "--image", "jpg"], "expected an image of .pgm"),
        ([str(tmp_path / "plan.txt")], "expected a .yaml file"),
    ):
        result = CliRunner().invoke(app, [*command, *options])
        assert result.exit_code == 2, options
        assert message in result.output
