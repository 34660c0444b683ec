"""Worlds with many solids: bodies shared by several solids report each by its name."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.signals import Pose, Twist
from navfw.sim import (
    BoxSpec,
    Circle,
    CylinderSpec,
    DepthImage,
    OpeningSpec,
    Rectangle,
    SensorParams,
    Simulation,
    WallSpec,
    WorldSpec,
    box_mesh,
    cylinder_mesh,
    gap_between,
    scenery,
    side_count,
)

ROBOT = RobotModel()
PERFECT = SensorParams.preset("perfect")
FIELD = WorldSpec(
    name="field",
    x=(-3, 8),
    y=(-3, 8),
    cylinders=tuple(
        CylinderSpec(name=f"pole-{i}-{j}", at=(i, j), radius=0.08, height=1.2)
        for i in range(6)
        for j in range(6)
    ),
    boxes=(BoxSpec(name="crate", at=(2.5, 2.5), size=(0.3, 0.5, 0.7), yaw=0.5),),
)


@pytest.mark.parametrize(
    ("start", "name"),
    [
        (Pose(-0.6, 2, 0), "pole-0-2"),
        (Pose(5.6, 4, np.pi), "pole-5-4"),
        (Pose(2.5, 1.8, np.pi / 2), "crate"),
    ],
)
def test_contacts_have_the_name_of_the_solid(start: Pose, name: str) -> None:
    with Simulation(FIELD, ROBOT, start, 0, PERFECT) as sim:
        for _ in range(120):
            sim.drive(*ROBOT.wheel_speeds(Twist(0.3, 0.0)))
            sim.advance(1.0 / 60.0)
            if sim.contacts:
                break
        assert sim.contacts == (name,)


def test_shared_and_separate_bodies_look_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    def view() -> tuple[Image, DepthImage]:
        with Simulation(FIELD, ROBOT, Pose(-0.6, 2.3, 0.2), 0, PERFECT) as sim:
            return sim.render_from(Pose(-0.6, 2.3, 0.2))

    image, depth = view()
    monkeypatch.setattr(scenery, "_MAX_SINGLE", 1000)
    other_image, other_depth = view()
    # rounding may move an edge by a pixel
    assert np.mean(image != other_image) < 0.01
    near = np.isfinite(depth) & np.isfinite(other_depth)
    assert np.mean(np.abs(depth[near] - other_depth[near]) < 0.01) > 0.99


def test_a_wall_of_many_pieces_collides_at_each_of_them() -> None:
    openings = tuple(
        OpeningSpec(name=f"gap-{i}", at=(2.0 + 2.0 * i, 0.0), width=0.9) for i in range(12)
    )
    wall = WallSpec(name="long", points=((0, 0), (26, 0)), openings=openings)
    world = WorldSpec(name="hall", x=(-2, 28), y=(-3, 3), walls=(wall,))
    with Simulation(world, ROBOT, Pose(25.0, -0.5, np.pi / 2), 0, PERFECT) as sim:
        for _ in range(120):
            sim.drive(*ROBOT.wheel_speeds(Twist(0.3, 0.0)))
            sim.advance(1.0 / 60.0)
        assert sim.contacts == ("long",)


def test_solids_may_overlap_with_may_overlap() -> None:
    boxes = [BoxSpec(name=name, at=(0, 0), size=(1, 1, 1)) for name in ("a", "b")]
    world = WorldSpec(name="pile", x=(-3, 3), y=(-3, 3), boxes=tuple(boxes), may_overlap=True)
    with Simulation(world, ROBOT, Pose(2, 0, 0), 0) as sim:
        assert sim.plan.clearance(2.0, 0.0) == pytest.approx(1.5)


@pytest.mark.parametrize("sides", [12, 24])
def test_cylinder_mesh(sides: int) -> None:
    mesh = cylinder_mesh(0.2, 3.0, np.zeros(2), sides)
    points = np.array(mesh.vertices)
    assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(0.2)
    assert (points[:, 2].min(), points[:, 2].max()) == (-1.5, 1.5)
    triangles = points[np.array(mesh.indices).reshape(-1, 3)]
    faces = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = np.array(mesh.normals)[np.array(mesh.indices).reshape(-1, 3)].mean(axis=1)
    assert np.all(np.sum(faces * normals, axis=1) >= 0.0)  # all face outwards
    assert np.min(mesh.uvs) >= 0.0


def test_moved_meshes_keep_their_texture() -> None:
    mesh, whole = box_mesh((0.4, 0.6, 1.0), np.zeros(2)), box_mesh((0.4, 0.6, 1.0), np.zeros(2))
    whole.add_mesh(mesh, (1.0, 2.0, 0.5), np.pi / 2)
    count = len(mesh.vertices)
    moved = np.array(whole.vertices[count:])
    original = np.array(mesh.vertices)
    assert moved == pytest.approx(
        np.column_stack([1 - original[:, 1], 2 + original[:, 0], original[:, 2] + 0.5])
    )
    assert whole.uvs[count:] == mesh.uvs
    assert min(whole.indices[len(mesh.indices) :]) == count


def test_side_count() -> None:
    assert side_count(0.02) == 12
    assert side_count(1.0) == 24
    assert 12 <= side_count(0.1) <= 24


@pytest.mark.parametrize(
    ("a", "b", "gap"),
    [
        (Circle(0, 0, 0.5), Circle(2, 0, 0.5), 1.0),
        (Circle(0, 0, 0.5), Rectangle(2, 0, 0.5, 3.0), 1.0),
        (Rectangle(0, 0, 1, 1), Rectangle(3, 0, 1, 1), 1.0),
        (Rectangle(0, 0, 1, 1), Rectangle(3, 3, 1, 1), np.sqrt(2.0)),
        (Rectangle(0, 0, 1, 1), Rectangle(0, 3, 1, 1, np.pi / 4), 2.0 - np.sqrt(2.0)),
        (Rectangle(0, 0, 3, 0.1), Rectangle(0, 0, 0.1, 3), -3.1),
    ],
)
def test_gap_between(a: Circle | Rectangle, b: Circle | Rectangle, gap: float) -> None:
    assert gap_between(a, b) == pytest.approx(gap)
    assert gap_between(b, a) == pytest.approx(gap)
