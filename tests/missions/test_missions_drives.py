"""Whole missions: in the office and the paper's room, past drops, closed passages and movers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_calls import put_files

from navfw.errors import InputError
from navfw.missions import MissionResult, prepare
from navfw.missions.outcome import Outcome
from navfw.papfis.papfis import Papfis
from navfw.sim import load_world
from navfw.sim.solids import drop_rectangle
from navfw.testing import MissionRun

MORE_SEEDS = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 10)]


@pytest.mark.mission(world="office", mission="lobby-to-lab", seeds=[1, *MORE_SEEDS])
def test_the_robot_drives_from_the_lobby_to_the_lab(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert mission.collisions == 0
    assert mission.path_length_m >= 15.0
    through_lobby_door = np.hypot(mission.path[:, 0] - 3.2, mission.path[:, 1] - 4.2) < 0.5
    through_lab_door = np.hypot(mission.path[:, 0] - 14.4, mission.path[:, 1] - 5.8) < 0.5
    assert through_lobby_door.any()
    assert through_lab_door.any()


@pytest.mark.mission(world="office", mission="lobby-to-lab", seeds=[1])
def test_commands_keep_the_robot_s_limits(mission: MissionRun) -> None:
    robot = mission.case.prepare().mission.spec.robot
    v, w = mission.commands[:, 1], mission.commands[:, 2]
    assert v.max() <= robot.max_v
    assert v.min() >= -robot.max_reverse
    assert np.abs(w).max() <= robot.max_w
    assert np.abs(v * w).max() <= robot.max_lateral + 1e-6


OTHERS = ["lab-to-lobby", "meeting-to-kitchen", "workshop-to-office-a", "kitchen-tour"]


@pytest.mark.slow
@pytest.mark.mission(world="office", mission=OTHERS, seeds=range(5))
def test_the_other_missions_of_the_office(mission: MissionRun) -> None:
    assert mission.outcome == "reached"


@pytest.mark.mission(world="paper-room", mission="through-the-door", seeds=[0, 1, *MORE_SEEDS])
def test_the_robot_finds_out_through_the_door(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert mission.min_clearance_m > 0.05
    assert mission.path[-1, 0] > 6.0, "it should stand beyond the partition"


@pytest.mark.mission(world="paper-room", mission="around-objects", seeds=[0, *MORE_SEEDS])
def test_objects_are_passed_without_contact(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert mission.collisions == 0
    assert mission.spl > 0.6


@pytest.mark.slow
@pytest.mark.mission(world="paper-room", mission="into-the-room", seeds=range(10))
def test_the_robot_finds_in_through_the_door(mission: MissionRun) -> None:
    assert mission.outcome == "reached"


DROP = "{name: shaft, x: [3, 4], y: [1.2, 2.4], depth: 0.8}"
ACROSS = """\
start: [1, 1.7, 0]
goals: [{x: 5.2, y: 1.7}]
tolerance: 0.3
drops:
  - %s
"""
HALL = """\
name: hall
x: [0, 6.4]
y: [0, 3.6]
walls:
  - {name: wall, points: [[0.05, 0.05], [6.35, 0.05], [6.35, 3.55], [0.05, 3.55], [0.05, 0.05]]}
"""


def hall(folder: Path, drop: str = DROP) -> tuple[Path, Path]:
    put_files(folder, {"world.yaml": HALL, "mission.yaml": ACROSS % drop})
    return folder / "world.yaml", folder / "mission.yaml"


def test_a_mission_s_drop_is_in_its_world_and_on_no_path(tmp_path: Path) -> None:
    session = prepare(*hall(tmp_path))
    assert [drop.name for drop in session.world.drops] == ["shaft"]
    assert session.plan.clearance(3.5, 1.8) < 0.0
    assert session.shortest > 4.3
    assert session.task.drops == {"shaft"}


@pytest.mark.parametrize(
    ("drop", "message"),
    [
        (DROP.replace("0.8", "0"), r"mission.yaml:5: drops\[0\].depth: expected a number >= 0.05"),
        (DROP.replace("[3, 4]", "[3, 9]"), r"mission.yaml:5: drops\[0\].x: 'shaft' extends beyond"),
        (DROP.replace("[3, 4]", "[0, 1.5]"), r"mission.yaml:5: drops\[0\].x: 'wall' would have no"),
        (DROP.replace("[3, 4]", "[0.5, 1.5]"), r"mission.yaml:1: start: .*'shaft'"),
    ],
)
def test_a_wrong_drop_is_named_with_line_and_key(tmp_path: Path, drop: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        prepare(*hall(tmp_path, drop))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_drop_is_detected_at_its_position_and_avoided(tmp_path: Path, seed: int) -> None:
    session = prepare(*hall(tmp_path), seed=seed)
    result = session.run()
    assert result.outcome is Outcome.REACHED, result.reason
    points = np.array(session.stack.local_map.drops.points())
    assert len(points) >= 3
    # odometry starts at the origin: the start is (1, 1.7), heading along x
    truth = drop_rectangle(session.world.drops[0]).distance(np.add(points, (1.0, 1.7)))
    assert truth.max() < 0.25


@pytest.mark.slow
@pytest.mark.mission(world="office", mission=["stairs", "door-closes"], seeds=range(2))
def test_unmapped_stairs_are_avoided_and_another_route_is_taken_when_a_door_closes(
    mission: MissionRun,
) -> None:
    assert mission.outcome == "reached"


@pytest.mark.slow
@pytest.mark.mission(world="office", mission="stairs-mapped")
def test_mapped_stairs_are_avoided_from_the_start(mission: MissionRun) -> None:
    assert mission.outcome == "reached"
    assert np.hypot(mission.path[:, 0] - 11.0, mission.path[:, 1] - 5.0).min() > 0.9


@pytest.mark.slow
@pytest.mark.mission(world="office", mission="only-door-closes")
def test_a_closed_only_door_ends_stuck_and_is_named(mission: MissionRun) -> None:
    assert mission.outcome == "stuck"
    assert "office-a-door - office-a-entrance" in mission.reason
    (event,) = mission.events
    assert mission.log.time[-1] - event.began_s < 60.0 + 3.0


PAIR = """\
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
CRATE = "boxes:\n  - {name: crate, at: [5.3, 1.5], size: [0.5, 1.1, 0.8], texture: wood}\n"
PAIR_MAP = """\
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
CROSS = "map: pair\nstart: [1.2, 1.5, 0]\ngoals: [east]\ntimeout: 200\n"


def test_a_blocked_passage_is_detected_and_avoided(workdir: Path) -> None:
    files = {
        "navfw.toml": "",
        "worlds/pair/world.yaml": PAIR,
        "worlds/pair/missions/cross.yaml": CROSS,
        "maps/pair.yaml": PAIR_MAP,
        "barred.yaml": PAIR + CRATE,
    }
    put_files(workdir, files)
    session = prepare("pair", "cross", seed=1)  # with free gaps, as the map says
    result = replace(session, world=load_world(workdir / "barred.yaml")).run()
    assert result.outcome is Outcome.REACHED, result.reason
    assert result.collisions == 0
    planner = result.session.stack.planner.plugin
    assert isinstance(planner, Papfis)
    assert planner.replans >= 1
    passed = result.log.true
    assert passed[:, 1].max() > 4.0  # through the northern gap


WALKED = """\
name: hall
x: [-6, 6]
y: [-6, 6]
movers:
  - {name: anna, path: [[2, 0], [-4, 0]], speed: 0.6, yields: false}
"""
UP = """\
start: [0, 0, 1.5708]
goals: [{x: 0, y: 5}]
timeout: 20
robot: {max_v: 0.02}
"""


def go_up(folder: Path, world: str = WALKED) -> MissionResult:
    put_files(folder, {"world.yaml": world, "missions/up.yaml": UP})
    return prepare(folder, "up", overrides=["mission.timeout=3"]).run()


def test_a_robot_hit_by_a_mover_is_not_the_cause(tmp_path: Path) -> None:
    # a robot that hardly moves, and a mover from its right
    result = go_up(tmp_path)
    assert result.outcome is Outcome.COLLIDED
    assert result.collision_cause == "mover"
    assert result.summary()["collision_cause"] == "mover"
    # the static plan alone, which is empty, would give an infinite clearance
    assert result.min_clearance_m == pytest.approx(0.0, abs=0.02)


def test_without_collision_there_is_no_cause(tmp_path: Path) -> None:
    result = go_up(tmp_path, WALKED.replace("yields: false", "yields: true"))
    assert result.outcome is Outcome.TIMEOUT
    assert result.collision_cause is None
    assert 0.5 < result.min_clearance_m < 0.7
