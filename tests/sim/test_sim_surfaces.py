"""Surfaces: textures, patterns and pictures; meshes; skirting boards and door frames."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np
import pytest
from cli_calls import put_file

from navfw.errors import ConfigError
from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import Simulation, WorldSpec, load_world
from navfw.sim.soft_light import SoftLight
from navfw.sim.solids import solids_of
from navfw.sim.surface_patches import (
    STRETCHED,
    SurfacePatch,
    floor_patches,
    solid_patches,
    wall_patches,
)
from navfw.sim.textures import TILE, luminance_pattern, picture_texture, synthesize
from navfw.sim.worldspec import Style, TextureSpec

STYLES = get_args(Style)


@pytest.mark.parametrize("style", STYLES)
def test_same_seed_same_texture(style: Style) -> None:
    spec = TextureSpec(style=style, seed=5)
    first = synthesize(spec).copy()
    synthesize.cache_clear()
    assert np.array_equal(first, synthesize(spec))
    other = synthesize(TextureSpec(style=style, seed=6))
    assert np.abs(first.astype(int) - other).mean() > 10


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("finest", [0.03, 0.06])
def test_no_detail_finer_than_specified(style: Style, finest: float) -> None:
    pattern = luminance_pattern(TextureSpec(style=style, finest=finest))
    power = np.abs(np.fft.fft2(pattern - pattern.mean())) ** 2
    cycles = np.fft.fftfreq(len(pattern), d=TILE / len(pattern))
    frequency = np.hypot(cycles[:, None], cycles[None, :])
    # at f = 80 px a detail of 0.03 m is two pixels wide at 1.2 m (METHOD sec 0)
    assert power[frequency > 0.5 / finest].sum() < 0.01 * power.sum()
    assert power[frequency > 1.0 / finest].sum() < 0.001 * power.sum()


@pytest.mark.parametrize("style", STYLES)
def test_brightness_and_contrast_of_a_periodic_texture(style: Style) -> None:
    pattern = luminance_pattern(TextureSpec(style=style, brightness=130, contrast=40))
    assert pattern.mean() == pytest.approx(130, abs=0.1)
    assert pattern.std() == pytest.approx(40, abs=0.1)
    assert pattern.min() > 0
    assert pattern.max() < 255
    # no step between last and first is larger than the steps inside (courses of bricks have edges)
    across = np.abs(np.diff(pattern, axis=1)).mean(axis=0).max()
    assert np.abs(pattern[:, 0] - pattern[:, -1]).mean() < 1.3 * across
    down = np.abs(np.diff(pattern, axis=0)).mean(axis=1).max()
    assert np.abs(pattern[0] - pattern[-1]).mean() < 1.3 * down


def test_tint_keeps_the_luminance() -> None:
    grey = synthesize(TextureSpec(contrast=30))
    warm = synthesize(TextureSpec(contrast=30, colour=(1.0, 0.9, 0.7)))
    luma = warm @ np.array([0.299, 0.587, 0.114])
    assert np.abs(luma - grey[:, :, 0]).max() < 2.0
    assert warm[:, :, 0].mean() > warm[:, :, 2].mean() + 20


WALL = """\
name: gallery
x: [0, 8]
y: [0, 8]
walls:
  - {name: wall, points: [[4, 1], [4, 7]], texture: stripes}
textures:
  stripes: {picture: pictures/stripes.png, size: %s, finest: 0.03}
light: {ambient: 1.0, diffuse: 0.0}
"""


def gallery(folder: Path, image: np.ndarray, size: str = "0.5") -> Path:
    """A world file whose wall shows ``image``."""
    (folder / "pictures").mkdir(parents=True)
    cv2.imwrite(str(folder / "pictures" / "stripes.png"), image)
    return put_file(folder, "world.yaml", WALL % size)


def texels_of(folder: Path, **keys: Any) -> Image:
    """The texture of the picture of ``gallery``."""
    return picture_texture(TextureSpec(picture=str(folder / "pictures" / "stripes.png"), **keys))


def test_a_picture_repeats_at_its_size_across_the_patches_of_a_wall(tmp_path: Path) -> None:
    stripes = np.zeros((40, 100, 3), np.uint8)
    stripes[:, 50:] = 200
    robot, pose = RobotModel(), Pose(2.0, 4.0, 0.0)
    world = load_world(gallery(tmp_path, stripes))
    with Simulation(world, robot, pose, 0) as sim:
        image, _ = sim.render_from(pose)
    # grey values of one row of the wall 1.95 m in front of the robot's middle
    row = image[40].astype(float)
    edges = np.flatnonzero(np.diff((row > 100).astype(int)))
    distance = 3.95 - pose.x - robot.camera.mount_forward
    half_period = 0.25 * robot.camera.focal / distance
    assert edges.size >= 4
    assert np.diff(edges) == pytest.approx(half_period, abs=1.1)


def test_a_picture_stands_upright_and_is_not_mirrored(tmp_path: Path) -> None:
    corner = np.full((100, 100, 3), 40, np.uint8)
    corner[:50, 50:] = 220  # bright at the upper right
    world = load_world(gallery(tmp_path, corner[..., ::-1], "8"))
    texels = texels_of(tmp_path, size=1.0, finest=0.01)
    middle = texels.shape[0] // 2
    assert texels[:middle, middle:].mean() > 200
    assert texels[middle:].mean() < 60
    with Simulation(world, RobotModel(), Pose(2.0, 4.0, 0.0), 0) as sim:
        image, _ = sim.render_from(Pose(2.0, 4.0, 0.0))
    # 8 m wide: of the wall from y = 1 to 7 the texture's right half shows y < 4, to the right, and
    # its lower half z < 4, all that there is of the wall
    assert image[40:60].max() < 60


def test_colours_are_those_of_the_file_without_detail_finer_than_resolved(tmp_path: Path) -> None:
    orange = np.full((30, 30, 3), (0, 128, 255), np.uint8)  # blue, green, red
    gallery(tmp_path / "a", orange)
    texels = texels_of(tmp_path / "a")
    assert texels.reshape(-1, 3).mean(axis=0) == pytest.approx((255, 128, 0), abs=1)
    fine = (np.indices((256, 256)).sum(axis=0) % 2 * 255).astype(np.uint8)
    gallery(tmp_path / "b", np.repeat(fine[..., None], 3, axis=2))
    texels = texels_of(tmp_path / "b", size=2.0)
    assert texels.std() < 2.0
    assert texels.mean() == pytest.approx(127, abs=3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (np.zeros((4000, 5000), np.uint8), "5000 x 4000 pixels, at most 4000000; scale it down"),
        (np.zeros((10, 300), np.uint8), "300 x 10 pixels; its sides .* factor of 20 .*: cut it"),
        (b"GIF89a, or not", "give a PNG or JPEG file"),
        (None, "no such file"),
    ],
)
def test_pictures_that_cannot_be_used(
    tmp_path: Path, content: np.ndarray | bytes | None, message: str
) -> None:
    path = gallery(tmp_path, content if isinstance(content, np.ndarray) else np.zeros((9, 9)))
    picture = tmp_path / "pictures" / "stripes.png"
    if content is None:
        picture.unlink()
    elif isinstance(content, bytes):
        picture.write_bytes(content)
    with pytest.raises(ConfigError, match=f"stripes.png.*{message}") as caught:
        load_world(path)
    assert caught.value.line == 7
    assert caught.value.key == "textures.stripes.picture"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"picture": "a.png", "contrast": 20.0}, "leave out contrast"),
        ({"picture": "a.png", "style": "wood"}, "leave out style"),
        ({"size": 1.0}, "size is for a picture"),
    ],
)
def test_a_texture_is_a_pattern_or_a_picture(keys: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TextureSpec.model_validate(keys)


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


def test_frames_stand_around_openings_and_out_of_the_wall() -> None:
    world = WorldSpec.model_validate(ROOM | TRIM)
    frames = [p for p in patches_of(world) if p.texture == "frame" and p.plane is None]
    assert len(frames) == 3
    assert extent(frames, 0) == {3.89, 4.11}
    assert {2.425, 2.505, 3.495, 3.575} <= extent(frames, 1)
    assert extent(frames, 2) == {0.0, 2.0, 2.08}
    below_the_lintel = [p for p in patches_of(world) if p.plane and p.plane[2] < -0.9]
    assert {patch.texture for patch in below_the_lintel} == {"frame"}
    assert solids_of(world) == solids_of(WorldSpec.model_validate(ROOM))


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


def levels_of(world: WorldSpec, patches: Iterable[SurfacePatch]) -> dict[tuple[float, ...], float]:
    """Brightness of the corners of ``patches`` in the world's light, by place [m]."""
    lit = [SoftLight(world).lit(patch.mesh) for patch in patches]
    return {
        tuple(np.round(vertex, 6).tolist()): normal[2]
        for mesh in lit
        for vertex, normal in zip(mesh.vertices, mesh.normals, strict=True)
    }


def test_soft_light_is_darker_where_surfaces_meet_and_even_elsewhere() -> None:
    world = WorldSpec.model_validate(ROOM | {"light": {"soft": True}})
    floor = levels_of(world, floor_patches(world))
    assert floor[(8.0, 6.0, 0.0)] == pytest.approx(0.95, abs=0.01)
    assert min(level for (x, _, _), level in floor.items() if 3.9 <= x <= 4.1) < 0.6
    walls = levels_of(world, patches_of(world))
    on_face = {place: level for place, level in walls.items() if place[0] == 3.9}
    foot, middle = (
        [level for place, level in on_face.items() if low <= place[2] <= high]
        for low, high in ((0.0, 0.01), (1.0, 1.5))
    )
    assert np.mean(foot) < np.mean(middle) - 0.1
    plain = next(floor_patches(world)).mesh
    assert SoftLight(WorldSpec.model_validate(ROOM)).lit(plain) is plain


def test_a_front_covers_the_two_longer_sides_of_a_box_once() -> None:
    box = {"name": "desk", "at": [2, 2], "size": [0.7, 1.6, 0.75], "front": "board"}
    world = WorldSpec.model_validate(ROOM | {"boxes": [box]})
    (desk,) = [solid for solid in solids_of(world) if solid.kind == "box"]
    body, front = solid_patches(desk)
    assert front.texture == f"{STRETCHED}board"
    assert extent([front], 0) == {1.65, 2.35}
    assert extent([front], 1) == {1.2, 2.8}
    assert np.array(front.mesh.uvs).max() < 1.0
    assert len(front.mesh.vertices) == 8
    sides = {tuple(np.round(normal, 6)) for normal in body.mesh.normals}
    assert sides == {(0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)}
