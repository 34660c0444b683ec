"""Loads the meshes of furniture from mesh files or URDFs, in metres and z up."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from navfw.config.foreign_files import element_error
from navfw.config.input_file import cached_by_files, shown_path
from navfw.errors import ConfigError
from navfw.meshes.mesh_file import MAX_TRIANGLES, TriangleMesh, joined, read_mesh, solid_mesh
from navfw.numerics.products import product
from navfw.robot.urdf import read_urdf
from navfw.robot.urdf_meshes import mesh_file
from navfw.robot.urdf_model import UrdfCollision, UrdfModel, attribute_numbers

Up = Literal["y", "z"]

_MIN_SIZE, _MAX_SIZE = 0.02, 50.0
"""Smallest and largest allowed extent of a mesh along its longest axis [m]."""
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""Turns the y axis up."""


@cached_by_files(64)
def furniture_mesh(file: str, scale: float, up: Up) -> TriangleMesh:
    """Load a mesh file, or a URDF's collision shapes with all joints at zero, in metres, z up.

    Raises:
        ConfigError: the file cannot be used (see ``read_mesh`` and ``read_urdf``), a URDF has no
            collision shapes or one that cannot be drawn, or the scaled mesh is smaller than 2 cm or
            larger than 50 m.

    """
    path = Path(file)
    mesh = _urdf_mesh(path) if path.suffix.lower() == ".urdf" else read_mesh(path)
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


# --- shapes of URDFs --------------------------------------------------------------------------


def _urdf_mesh(path: Path) -> TriangleMesh:
    """Return the collision shapes of all links in the axes of the root link [m]."""
    model = read_urdf(path)
    if not model.collisions:
        what = "no link has a collision shape; add <collision> elements, which are drawn as well"
        raise ConfigError(what, file=shown_path(path))
    return joined(
        [
            _shape_mesh(model, collision).moved(
                product(model.frame_of(collision.link), collision.frame)
            )
            for collision in model.collisions
        ]
    )


def _shape_mesh(model: UrdfModel, collision: UrdfCollision) -> TriangleMesh:
    """Return the mesh of one <geometry>, around its own origin."""
    shape, size = collision.shape, collision.size
    if size is not None:
        if min(size) <= 0.0:
            key = "size" if shape.tag == "box" else "length" if collision.radius > 0.0 else "radius"
            raise element_error(shape, f"{key} of <{shape.tag}>: expected positive lengths [m]")
        return solid_mesh(shape.tag, size)
    mesh = read_mesh(mesh_file(model, shape))
    scale = attribute_numbers(shape, "scale", [1.0, 1.0, 1.0])
    if min(scale) > 0.0:
        return mesh.moved(np.diag([*scale, 1.0]))
    what = "expected positive scales; mirror the mesh in a modelling program"
    raise element_error(shape, what)
