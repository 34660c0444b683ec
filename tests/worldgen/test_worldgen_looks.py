"""Looks of generated worlds: other surfaces on the same geometry."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from navfw.errors import InputError, UnknownNameError
from navfw.sim import Look, load_world
from navfw.suite import EntrySpec
from navfw.worldgen import generate

SURFACES = {"textures", "skirting", "door_frames"}


@pytest.mark.parametrize(("look", "digest"), [("plain", "189ff407a08f"), ("photo", "d137220a6376")])
def test_a_look_changes_surfaces_alone_and_is_the_seeds(
    look: Look, digest: str, tmp_path: Path
) -> None:
    usual, made = generate("rooms", 3, 0.5), generate("rooms", 3, 0.5, look=look)
    assert made.world.model_dump(exclude=SURFACES) == usual.world.model_dump(exclude=SURFACES)
    assert hashlib.sha256(made.world.model_dump_json().encode()).hexdigest().startswith(digest)
    assert made.mission == usual.mission
    assert set(usual.world.textures) <= set(made.world.textures)
    assert generate("rooms", 3, 0.5, look=look).world == made.world
    folder = made.write(tmp_path / "made")
    assert load_world(folder / "world.yaml") == made.world


def test_plain_walls_have_less_contrast_than_noise_and_boards_that_stand_out() -> None:
    for seed in range(4):
        world = generate("corridors", seed, 0.5, look="plain").world
        walls = {world.textures[wall.texture] for wall in world.walls}
        assert all(wall.contrast <= 4.0 for wall in walls)
        assert world.skirting is not None
        board = world.textures[world.skirting.texture]
        assert all(abs(wall.brightness - board.brightness) > 20.0 for wall in walls)
        assert world.door_frames is not None


def test_photo_surfaces_are_materials() -> None:
    world = generate("rooms", 5, 0.5, look="photo").world
    styles = {texture.style for texture in world.textures.values()}
    assert styles <= {"concrete", "brick", "parquet", "rug", "roughcast"}
    assert len(styles) >= 3
    assert world.skirting is None


def test_looks_that_are_none() -> None:
    with pytest.raises(UnknownNameError, match="unknown look 'plane': did you mean 'plain'"):
        generate("rooms", 0, 0.5, look="plane")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="contrast: a look has contrasts of its own"):
        generate("rooms", 0, 0.5, 3.0, "plain")
    with pytest.raises(ValueError, match="look is for a family"):
        EntrySpec(world="office", look="plain")
