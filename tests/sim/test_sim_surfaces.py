"""Surfaces: textures, patterns and pictures; meshes; skirting boards and door frames."""

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
from navfw.sim.solids import solids_of
from navfw.sim.surface_patches import SurfacePatch, wall_patches
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
