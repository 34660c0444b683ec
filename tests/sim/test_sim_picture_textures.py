"""Pictures as textures: their size in metres, no aliasing detail, bad files refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from navfw.errors import ConfigError
from navfw.robot import RobotModel
from navfw.signals import Pose
from navfw.sim import Simulation, TextureSpec, load_world, picture_texture, read_picture

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
    (folder / "pictures").mkdir()
    cv2.imwrite(str(folder / "pictures" / "stripes.png"), image)
    path = folder / "world.yaml"
    path.write_text(WALL % size)
    return path


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
    picture = corner[..., ::-1]
    texels = picture_texture(
        TextureSpec(picture=str(written(tmp_path, picture)), size=1.0, finest=0.01)
    )
    middle = texels.shape[0] // 2
    assert texels[:middle, middle:].mean() > 200
    assert texels[middle:].mean() < 60
    world = load_world(gallery(tmp_path, picture, "8"))
    with Simulation(world, RobotModel(), Pose(2.0, 4.0, 0.0), 0) as sim:
        image, _ = sim.render_from(Pose(2.0, 4.0, 0.0))
    # 8 m wide: of the wall from y = 1 to 7 the texture's right half shows y < 4, to the right, and
    # its lower half z < 4, all that there is of the wall
    assert image[40:60].max() < 60


def written(folder: Path, image: np.ndarray) -> Path:
    path = folder / "alone.png"
    cv2.imwrite(str(path), image)
    return path


def test_detail_finer_than_the_camera_resolves_is_removed(tmp_path: Path) -> None:
    fine = (np.indices((256, 256)).sum(axis=0) % 2 * 255).astype(np.uint8)
    path = str(written(tmp_path, np.repeat(fine[..., None], 3, axis=2)))
    texels = picture_texture(TextureSpec(picture=path, size=2.0))
    assert texels.std() < 2.0
    assert texels.mean() == pytest.approx(127, abs=3)


def test_colours_are_those_of_the_file(tmp_path: Path) -> None:
    orange = np.full((30, 30, 3), (0, 128, 255), np.uint8)  # blue, green, red
    texels = picture_texture(TextureSpec(picture=str(written(tmp_path, orange))))
    assert texels.reshape(-1, 3).mean(axis=0) == pytest.approx((255, 128, 0), abs=1)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((4000, 5000), r"5000 x 4000 pixels, at most 4000000; scale it down"),
        ((10, 300), r"300 x 10 pixels; its sides may differ by a factor of 20 at most: cut it"),
    ],
)
def test_pictures_of_the_wrong_size_are_refused(
    tmp_path: Path, shape: tuple[int, int], message: str
) -> None:
    path = gallery(tmp_path, np.zeros(shape, np.uint8))
    with pytest.raises(ConfigError, match=message) as caught:
        load_world(path)
    assert caught.value.line == 7
    assert caught.value.key == "textures.stripes.picture"
    assert "stripes.png" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "no such file"), (b"GIF89a, or not", "give a PNG or JPEG file")],
)
def test_missing_and_broken_pictures_are_refused(
    tmp_path: Path, content: bytes | None, message: str
) -> None:
    path = gallery(tmp_path, np.zeros((20, 20), np.uint8))
    picture = tmp_path / "pictures" / "stripes.png"
    picture.unlink()
    if content is not None:
        picture.write_bytes(content)
    read_picture.cache_clear()
    with pytest.raises(ConfigError, match=message):
        load_world(path)


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
