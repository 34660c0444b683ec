"""Rendered scenes: what a glossy floor mirrors, labels by the truth, and the command."""

import numpy as np
import pytest
from cli_calls import answer, refusal
from navfw_benchmarks.bench import real_benchmark
from navfw_benchmarks.bench.rendered_scenes import KINDS, label_of, mirrored, with_low_things
from navfw_benchmarks.bench.true_pairs import MovingPose
from navfw_benchmarks.bench.view_truth import WallGeometry

from navfw.robot import CameraModel, RobotModel
from navfw.signals import Pose, Twist
from navfw.sim import SceneGeometry, Simulation, WorldSpec
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import CylinderSpec, WallSpec

ROBOT = RobotModel(camera=CameraModel(width=320, height=240, mount_height=0.25))
QUADRANTS = {"upper_left", "upper_right", "lower_left", "lower_right"}
OUTLINE = ((0.05, 0.05), (11.95, 0.05), (11.95, 13.95), (0.05, 13.95), (0.05, 0.05))
LANE = tuple(WallSpec(name=f"lane-{y:g}", points=((4.0, y), (11.0, y))) for y in (1.3, 2.7))
HALL = WorldSpec(
    name="hall",
    x=(0.0, 12.0),
    y=(0.0, 14.0),
    walls=(WallSpec(name="outline", points=OUTLINE), *LANE),
    cylinders=(CylinderSpec(name="post", at=(3.0, 4.6), radius=0.1),),
)


def test_a_glossy_floor_mirrors_what_stands_on_it() -> None:
    camera, rows = ROBOT.camera, np.arange(240) - 119.5
    foot = 40
    wall = np.full((240, 320), camera.focal * camera.mount_height / foot)
    ground = camera.focal * camera.mount_height / np.maximum(rows, 1e-9)[:, None]
    depth = np.where(rows[:, None] < foot, wall, ground).astype(np.float32)
    stripes = np.where(rows[:, None] < foot, 100.0 + rows[:, None], 0.0) + np.zeros((1, 320))
    image = stripes.astype(np.uint8)
    assert mirrored(image, depth, camera, 0.0).tolist() == image.tolist()
    shiny = mirrored(image, depth, camera, 0.5)
    edge = 120 + foot
    assert shiny[:edge].tolist() == image[:edge].tolist()
    for below in (3, 20, 70):
        assert shiny[edge + below, 7] == pytest.approx(0.5 * image[edge - below, 7], abs=1.0)


@pytest.mark.parametrize(
    ("pose", "nearest", "front", "floor"),
    [
        (Pose(10.5, 5.0, 0.0), QUADRANTS, "wall", "yes"),
        (Pose(11.6, 5.0, 0.0), QUADRANTS, "wall", "no"),
        (Pose(5.0, 2.0, 0.0), QUADRANTS, "corridor", "yes"),
        (Pose(4.0, 8.0, 0.0), {"none"}, "open", "yes"),
        (Pose(2.0, 4.0, 0.0), {"upper_left", "lower_left"}, "open", "yes"),
    ],
)
def test_labels_follow_from_depth_and_walls(
    pose: Pose, nearest: set[str], front: str, floor: str
) -> None:
    with Simulation(HALL, ROBOT, Pose(4.0, 8.0, 0.0), 0) as simulation:
        _, depth = simulation.render_from(pose)
    label = label_of(WallGeometry(HALL), pose, depth, ROBOT)
    assert (set(label[0]), label[2], label[3]) == (nearest, floor, front)
    assert front not in label[4]


def test_low_things_lie_on_the_floor() -> None:
    plan = SceneGeometry.from_world(HALL, ROBOT.height)
    view = MovingPose(Pose(11.2, 5.0, 0.0), Twist(0.3, 0.0))
    world = with_low_things(np.random.default_rng(0), HALL, plan, view, KINDS["low things"])
    check_world(world)
    assert len(world.boxes) + len(world.cylinders) < 1 + KINDS["low things"].low


def test_the_command_judges_each_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_benchmark, "KINDS", {"low things": KINDS["low things"]})
    words = ("bench", "scenes", "--count", "1", "--flow", "registered", "--split")
    found = answer(*words, "all")
    row = found["flows"]["registered"]["parts"]["low things"]
    assert found["frames"] == sum(row["verdicts"].values()) == 4
    assert row["verdicts"]["right"] + row["verdicts"]["partly"] >= 2
    assert "tuning, test" in refusal(*words, "x")
