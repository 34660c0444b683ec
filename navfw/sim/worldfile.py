"""Reading a world file: parse YAML, validate against the specification, check the geometry."""

from __future__ import annotations

from pathlib import Path

from navfw.config.document import YamlDocument, load_yaml
from navfw.config.yamlfile import validate
from navfw.meshes.furniture_meshes import furniture_mesh
from navfw.sim.textures import read_picture
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import WorldSpec


def load_world(path: str | Path) -> WorldSpec:
    """Read and check a world file.

    Raises:
        ConfigError: the file cannot be read or breaks the schema (every problem with its line).
        WorldError: its geometry is impossible: an opening off its wall, overlapping solids, a name
            given twice, an unknown texture or opening.
        ConfigError: a picture or mesh cannot be used (with the world's file, line and key).

    """
    document = load_yaml(Path(path))
    spec = _with_files(document, validate(document, WorldSpec), Path(path).parent)
    check_world(spec, file=Path(document.file or path), line_of=document.line_of)
    return spec


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
            furniture_mesh(path, mesh.scale, mesh.up)
        meshes[i] = mesh.model_copy(update={"file": path})
    return world.model_copy(update={"textures": textures, "meshes": tuple(meshes)})
