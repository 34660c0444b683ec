"""A blocked passage that is open on the map: detection, detour, or a report that it is closed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from navfw.missions import MissionResult, Outcome, prepare
from navfw.papfis import Papfis
from navfw.sim import load_world

WORLD = """\
name: pair
description: Two rooms, two gaps between them.
x: [0, 10]
y: [0, 6]
walls:
  - name: outer
    points: [[0.05, 0.05], [9.95, 0.05], [9.95, 5.95], [0.05, 5.95], [0.05, 0.05]]
  - name: partition
    points: [[5, 0.05], [5, 5.95]]
    openings:
      - {name: south-gap, at: [5, 1.5], width: 1.0}
      - {name: north-gap, at: [5, 4.5], width: 1.0}
"""
CRATE = "  - {{name: {name}, at: [5.3, {y}], size: [0.5, 1.1, 0.8], texture: wood}}\n"
MAP = """\
name: pair
places:
  west: {x: 2.0, y: 1.5}
  west-south: {x: 4.2, y: 1.5}
  south-door: {x: 5, y: 1.5, kind: door}
  east-south: {x: 5.8, y: 1.5}
  west-north: {x: 4.2, y: 4.5}
  north-door: {x: 5, y: 4.5, kind: door}
  east-north: {x: 5.8, y: 4.5}
  east: {x: 8.0, y: 1.5}
edges:
  - {from: west, to: west-south, width: 2.0}
  - {from: west-south, to: south-door, width: 1.0}
  - {from: south-door, to: east-south, width: 1.0}
  - {from: east-south, to: east, width: 2.0}
  - {from: west, to: west-north, width: 1.6}
  - {from: west-south, to: west-north, width: 1.6}
  - {from: west-north, to: north-door, width: 1.0}
  - {from: north-door, to: east-north, width: 1.0}
  - {from: east-north, to: east-south, width: 1.6}
  - {from: east-north, to: east, width: 1.6}
"""
MISSION = "map: pair\nstart: [1.2, 1.5, 0]\ngoals: [east]\ntimeout: 200\n"


def drive(folder: Path, monkeypatch: pytest.MonkeyPatch, *barred: float) -> MissionResult:
    """Cross from west to east with unmapped crates in the gaps at these y [m]."""
    files = {
        "navfw.toml": "",
        "worlds/pair/world.yaml": WORLD,
        "worlds/pair/missions/cross.yaml": MISSION,
        "maps/pair.yaml": MAP,
        "barred.yaml": WORLD
        + "boxes:\n"
        + "".join(CRATE.format(name=f"c{y}", y=y) for y in barred),
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.chdir(folder)
    session = prepare("pair", "cross", seed=1)
    # prepared with free gaps: an impossible mission is refused
    return replace(session, world=load_world(folder / "barred.yaml")).run()


def test_a_blocked_passage_is_detected_and_avoided(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = drive(tmp_path, monkeypatch, 1.5)
    assert result.outcome is Outcome.REACHED, result.reason
    assert result.metrics.collisions == 0
    planner = result.session.stack.planner.plugin
    assert isinstance(planner, Papfis)
    assert planner.replans >= 1
    passed = result.run.log.true
    assert passed[:, 1].max() > 4.0  # through the northern gap


@pytest.mark.slow
def test_with_all_passages_blocked_the_mission_ends_stuck_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = drive(tmp_path, monkeypatch, 1.5, 4.5)
    assert result.outcome is Outcome.STUCK, result.reason
    assert result.reason.startswith("the only route to east is closed: ")
    assert "door" in result.reason
    assert result.run.sim_time < 120.0
