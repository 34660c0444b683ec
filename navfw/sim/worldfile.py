"""Loads a world file: parses YAML, validates it against the specification, checks the geometry."""

from __future__ import annotations

from pathlib import Path

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.yaml_text import key_text
from navfw.config.yamlfile import validate
from navfw.errors import WorldError
from navfw.sim.textures import read_picture
from navfw.sim.upright_parts import furniture_parts
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import WorldSpec

_SOLIDS, _LENGTHS = ("walls", "boxes", "cylinders"), ("at", "size", "points", "radius")
_MAX_RATIO = 5.0
"""Largest ratio of a length to the longer side of the floor; beyond it, units seem mistaken."""


def load_world(path: str | Path) -> WorldSpec:
    """Read and check a world file.

    Raises:
        ConfigError: the file cannot be read or breaks the schema (every problem with its line), or
            a picture or mesh cannot be used (with the world's file, line and key).
        WorldError: its geometry is impossible: an opening off its wall, overlapping solids, a name
            given twice, an unknown texture or opening; or lengths seem to be in millimetres.

    """
    document = load_yaml(Path(path))
    _ask_about_units(document)
    spec = _with_files(document, validate(document, WorldSpec), Path(path).parent)
    check_world(spec, file=Path(document.file or path), line_of=document.line_of)
    return spec


def _ask_about_units(document: YamlDocument) -> None:
    """Refuse walls and solids far larger than the floor, before each number is refused."""
    data = document.data
    try:
        limit = _MAX_RATIO * max(float(high) - float(low) for low, high in (data["x"], data["y"]))
        items = [(key, i, item) for key in _SOLIDS for i, item in enumerate(data.get(key) or ())]
    except (KeyError, OverflowError, TypeError, ValueError):
        return  # the specification reports what is wrong
    large = [(key, i) for key, i, item in items if _extent(item) > limit > 0.0]
    if large:
        what = f"beyond {limit:g} m, {_MAX_RATIO:g} times the floor; is that in millimetres?"
        also = "".join(f"; so is {key_text(key)}" for key in large[1:4])
        also += f"; and {len(large) - 4} more" if len(large) > 4 else ""
        with document.locating(large[0]):
            raise WorldError(f"{what} expected metres{also}")


def _extent(item: object) -> float:
    """Return the largest length or coordinate [m] of a wall or solid; 0 for anything else."""
    values = [item.get(key) for key in _LENGTHS] if isinstance(item, dict) else []
    for _ in range(2):  # points are lists in a list
        values = [v for value in values for v in (value if isinstance(value, list) else [value])]
    return max((abs(value) for value in values if isinstance(value, int | float)), default=0.0)


def _with_files(document: YamlDocument, world: WorldSpec, folder: Path) -> WorldSpec:
    """``world`` with its pictures and meshes by absolute path, each read to know that it can be."""
    textures, meshes = dict(world.textures), list(world.meshes)
    for name, texture in world.textures.items():
        if texture.picture is not None:
            path = str((folder / texture.picture).absolute())
            with document.locating(("textures", name, "picture")):
                read_picture(path)
            textures[name] = texture.model_copy(update={"picture": path})
    for i, mesh in enumerate(world.meshes):
        path = str((folder / mesh.file).absolute())
        with document.locating(("meshes", i, "file")):
            furniture_parts(path, mesh.scale, mesh.up)
        meshes[i] = mesh.model_copy(update={"file": path})
    return world.model_copy(update={"textures": textures, "meshes": tuple(meshes)})
