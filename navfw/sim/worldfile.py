"""Reading a world file: parse YAML, validate against the specification, check the geometry."""

from __future__ import annotations

from pathlib import Path

from navfw.config.document import load_yaml
from navfw.config.yamlfile import validate
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import WorldSpec

__all__ = ["load_world"]


def load_world(path: str | Path) -> WorldSpec:
    """Read and check a world file.

    Raises:
        ConfigError: the file cannot be read or breaks the schema (every problem with its line).
        WorldError: its geometry is impossible: an opening off its wall, overlapping solids, a name
            given twice, an unknown texture or opening.

    """
    document = load_yaml(Path(path))
    spec = validate(document, WorldSpec)
    check_world(spec, file=Path(document.file or path), line_of=document.line_of)
    return spec
