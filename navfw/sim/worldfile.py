"""Reading a world file: parse YAML, validate against the specification, check the geometry."""

from __future__ import annotations

from pathlib import Path

from navfw.config.document import YamlDocument, key_text, load_yaml
from navfw.config.yamlfile import validate
from navfw.errors import ConfigError
from navfw.sim.picture_textures import read_picture
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import WorldSpec

__all__ = ["load_world"]


def load_world(path: str | Path) -> WorldSpec:
    """Read and check a world file.

    Raises:
        ConfigError: the file cannot be read or breaks the schema (every problem with its line).
        WorldError: its geometry is impossible: an opening off its wall, overlapping solids, a name
            given twice, an unknown texture or opening.
        InputError: a picture cannot be used; the message has the world's file, line and key.

    """
    document = load_yaml(Path(path))
    spec = _with_pictures(document, validate(document, WorldSpec), Path(path).parent)
    check_world(spec, file=Path(document.file or path), line_of=document.line_of)
    return spec


def _with_pictures(document: YamlDocument, world: WorldSpec, folder: Path) -> WorldSpec:
    """``world`` with its pictures by absolute path, each read once to know that it can be."""
    textures = dict(world.textures)
    for name, texture in world.textures.items():
        if texture.picture is None:
            continue
        path = str((folder / texture.picture).absolute())
        try:
            read_picture(path)
        except ConfigError as error:
            key = ("textures", name, "picture")
            where = {"file": document.file, "line": document.line_of(key), "key": key_text(key)}
            raise ConfigError(str(error), **where) from None  # type: ignore[arg-type]
        textures[name] = texture.model_copy(update={"picture": path})
    return world if not textures else world.model_copy(update={"textures": textures})
