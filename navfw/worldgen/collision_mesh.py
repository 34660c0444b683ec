"""Reader of meshes (COLLADA, OBJ, STL) for their shape alone, by trimesh, an optional extra."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from navfw.config.input_file import read_input, shown_path
from navfw.config.xml_file import read_xml
from navfw.errors import ConfigError, InputError
from navfw.signals import Array

SUFFIXES = (".dae", ".obj", ".stl")
"""Files that can be read."""

MAX_BYTES = 50_000_000
"""Largest size of a mesh file [byte]: 1 million triangles of binary STL."""

MAX_TRIANGLES = 500_000
"""Largest number of triangles of a mesh; collision meshes of rooms have hundreds."""

_MAX_COORDINATE = 1e4
"""Largest coordinate [m]."""


def read_triangles(path: Path) -> Array:
    """The corners (n, 3, 3) [m] of the triangles of a mesh file.

    As Gazebo does it, the unit of a COLLADA file counts, its upward axis does not.

    Raises:
        ConfigError: the file cannot be read, is no such mesh, or is too large.
        InputError: the extra is not installed.

    """
    kind = path.suffix.lower()
    name = shown_path(path)
    if kind not in SUFFIXES:
        expected = ", ".join(SUFFIXES)
        raise ConfigError(f"expected a mesh ({expected}), got {kind or 'no suffix'}", file=name)
    data = read_input(path, MAX_BYTES)
    if kind == ".dae":
        read_xml(path, MAX_BYTES, "a COLLADA mesh")  # neither document type nor entities
    triangles = _parsed(data, kind[1:], name)
    if len(triangles) > MAX_TRIANGLES:
        raise ConfigError(
            f"has {len(triangles)} triangles, at most {MAX_TRIANGLES}; simplify the mesh", file=name
        )
    if not len(triangles) or not np.all(np.abs(triangles) < _MAX_COORDINATE):
        what = "no triangles" if not len(triangles) else f"coordinates beyond {_MAX_COORDINATE:g} m"
        raise ConfigError(f"has {what}; export the mesh again", file=name)
    return triangles


def _parsed(data: bytes, kind: str, name: str) -> Array:
    """The triangles (n, 3, 3) [m] in ``data``; neither textures nor other files are read."""
    try:
        import trimesh
        from trimesh.units import unit_conversion
    except ModuleNotFoundError:
        raise InputError(
            "meshes need the package trimesh, which is not installed: uv sync --extra meshes, or"
            " pip install 'navfw[meshes]'",
            file=name,
        ) from None
    try:
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type=kind, skip_materials=True)
        unit = unit_conversion(mesh.units, "meters") if kind == "dae" and mesh.units else 1.0
        return np.asarray(getattr(mesh, "triangles", ()), dtype=float).reshape(-1, 3, 3) * unit
    except Exception as error:  # whatever parsers of foreign files raise
        raise ConfigError(
            f"cannot be read as {kind.upper()}: {type(error).__name__}: {error}", file=name
        ) from None
