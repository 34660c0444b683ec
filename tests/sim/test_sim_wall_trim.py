"""Skirting boards and door frames: where they are drawn, and that they add no solid."""

from __future__ import annotations

import numpy as np
import pytest

from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import Simulation, SurfacePatch, WorldSpec, solids_of, wall_patches

ROOM = {
    "name": "room",
    "x": [0, 8],
    "y": [0, 6],
    "walls": [
        {
            "name": "divider",
            "points": [[4, 0.1], [4, 5.9]],
            "thickness": 0.2,
            "height": 2.4,
            "texture": "pale",
            "openings": [{"name": "gap", "at": [4, 3], "width": 1.0, "height": 2.0}],
        }
    ],
    "textures": {
        "pale": {"contrast": 0, "brightness": 180},
        "board": {"contrast": 0, "brightness": 40},
        "frame": {"contrast": 0, "brightness": 100},
    },
    "light": {"ambient": 1.0, "diffuse": 0.0},
}
TRIM = {
    "skirting": {"height": 0.1, "texture": "board"},
    "door_frames": {"width": 0.08, "texture": "frame"},
}


def patches_of(world: WorldSpec) -> list[SurfacePatch]:
    """All patches of the world's walls."""
    return [
        patch
        for solid in solids_of(world)
        if solid.kind in ("wall", "lintel")
        for patch in wall_patches(world, solid)
    ]


def extent(patches: list[SurfacePatch], axis: int) -> set[float]:
    """All coordinates [m] of the patches' corners along an axis."""
    return {round(v[axis], 6) for patch in patches for v in patch.mesh.vertices}


def test_skirting_boards_are_strips_at_the_foot_of_the_faces() -> None:
    world = WorldSpec.model_validate(ROOM | {"skirting": TRIM["skirting"]})
    boards = [patch for patch in patches_of(world) if patch.texture == "board"]
    assert extent(boards, 2) == {0.0, 0.1}
    assert {0.1, 2.5, 3.5, 5.9} <= extent(boards, 1)
    assert extent(boards, 0) == {3.9, 4.1}


def test_frames_surround_openings_on_both_faces_and_line_the_inside() -> None:
    world = WorldSpec.model_validate(ROOM | TRIM)
    frames = [patch for patch in patches_of(world) if patch.texture == "frame"]
    on_faces = [patch for patch in frames if patch.plane is not None and abs(patch.plane[0]) > 0.9]
    assert extent(on_faces, 0) == {3.9, 4.1}
    assert min(extent(on_faces, 1)) == pytest.approx(2.42)
    assert max(extent(on_faces, 1)) == pytest.approx(3.58)
    assert max(extent(on_faces, 2)) == pytest.approx(2.08)
    inside = [patch for patch in frames if patch.plane is not None and abs(patch.plane[1]) > 0.9]
    assert extent(inside, 1) == {2.5, 3.5}
    assert max(extent(inside, 2)) == 2.0
    below_the_lintel = [p for p in frames if p.plane is not None and p.plane[2] < -0.9]
    assert extent(below_the_lintel, 2) == {2.0}


def test_trim_covers_what_it_hides_and_nothing_else() -> None:
    bare, trimmed = (WorldSpec.model_validate(world) for world in (ROOM, ROOM | TRIM))

    def area(world: WorldSpec) -> float:
        total = 0.0
        for patch in patches_of(world):
            a, b, _, d = np.array(patch.mesh.vertices)
            total += float(np.linalg.norm(np.cross(b - a, d - a)))
        return total

    assert area(trimmed) == pytest.approx(area(bare))
    assert solids_of(trimmed) == solids_of(bare)


def test_the_camera_sees_the_boards() -> None:
    pose = Pose(2.0, 1.2, 0.0)
    seen = []
    for world in (ROOM, ROOM | TRIM):
        with Simulation(WorldSpec.model_validate(world), RobotModel(), pose, 0) as sim:
            image, _ = sim.render_from(pose)
        seen.append(image[:, 80])
    bare, trimmed = seen
    changed = np.flatnonzero(bare != trimmed)
    assert set(bare[changed]) == {180}
    assert set(trimmed[changed]) == {40}
    assert 3 <= changed.size <= 8  # 0.1 m at 1.8 m
