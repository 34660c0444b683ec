"""Meshes of furniture by file: OBJ, STL or URDF, scaled to metres, with the z axis up."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from navfw.config.input_file import shown_path
from navfw.errors import ConfigError
from navfw.numerics.products import product
from navfw.sim.mesh_file import MAX_TRIANGLES, TriangleMesh, read_mesh
from navfw.sim.mesh_outline import OutlineBox, boxes_around
from navfw.sim.urdf_shapes import read_urdf_shapes

Up = Literal["y", "z"]

_MIN_SIZE, _MAX_SIZE = 0.02, 50.0
"""Bounds of the largest extent of a mesh [m]."""
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Turns the y axis up."""


@lru_cache(maxsize=64)
def furniture_mesh(file: str, scale: float, up: Up) -> TriangleMesh:
    """The mesh in a file, or a URDF's collision shapes with all joints at zero, in metres, z up.

    Raises:
        ConfigError: the file cannot be used (see ``read_mesh`` and ``read_urdf_shapes``), or the
            scaled mesh is smaller than 2 cm or larger than 50 m.

    """
    path = Path(file)
    mesh = read_urdf_shapes(path) if path.suffix.lower() == ".urdf" else read_mesh(path)
    if len(mesh.faces) > MAX_TRIANGLES:
        what = f"has {len(mesh.faces)} triangles, at most {MAX_TRIANGLES}; simplify its meshes"
        raise ConfigError(what, file=shown_path(path))
    size = np.diag([scale, scale, scale, 1.0])
    mesh = mesh.moved(product(_Y_UP, size) if up == "y" else size)
    low, high = mesh.bounds
    extent = float((high - low).max())
    if not _MIN_SIZE <= extent <= _MAX_SIZE:
        what = (
            f"is {extent:g} m large, expected {_MIN_SIZE:g} to {_MAX_SIZE:g} m: give another scale"
        )
        raise ConfigError(f"{what} (0.001 for a file in millimetres)", file=shown_path(path))
    return mesh


@lru_cache(maxsize=64)
def furniture_outline(file: str, scale: float, up: Up) -> tuple[OutlineBox, ...]:
    """The boxes around the mesh in a file (see ``navfw.sim.mesh_outline``); raises like it."""
    return boxes_around(furniture_mesh(file, scale, up))
