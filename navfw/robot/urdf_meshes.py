"""Find and read mesh files of a URDF, and write the file that PyBullet loads."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from xml.etree.ElementTree import indent, tostring

import numpy as np

from navfw.config.foreign_files import element_error
from navfw.config.input_file import cached_by_files, is_file, is_folder, read_input, shown_path
from navfw.config.lookup import package_folders, package_roots
from navfw.errors import ConfigError
from navfw.meshes import read_triangles
from navfw.numerics import Array
from navfw.robot.urdf_model import (
    UrdfCollision,
    UrdfModel,
    attribute_numbers,
    is_shaped,
)

_PACKAGE, _FILE = re.compile("(package|model)://"), "file://"
"""Prefixes of the names of meshes: in a package of ROS, and at an absolute path."""
_ONE_TRIANGLE = 84 + 50  # defined
"""Length of a binary STL file with one triangle [bytes]."""
_MAX_TRIANGLES = 500_000  # chosen
"""Largest number of triangles of a mesh that collides."""
_MAX_SIZE = 20.0  # chosen
"""Largest extent of a robot's mesh [m]: one of 30 cm in millimetres is 300 m large."""


def mesh_path(model: UrdfModel, name: str) -> Path | None:
    """Where the mesh called ``name`` is, or should be; None if its package is not there."""
    if not (prefix := _PACKAGE.match(name)):
        return model.file.parent / name.removeprefix(_FILE)
    package, _, rest = name[prefix.end() :].partition("/")
    folders = package_folders(package, package_roots(model.file, model.packages))
    paths = [folder / rest for folder in folders if is_folder(folder)]
    return next((path for path in paths if is_file(path)), paths[0] if paths else None)


def check_meshes(model: UrdfModel) -> None:
    """Check that the files of all meshes that collide exist; PyBullet would drop the shape.

    Meshes that are only seen may be missing: no camera sees its own robot. None may be empty.
    """
    colliding = set(model.root.iterfind("link/collision/geometry/mesh"))
    for mesh in model.root.iter("mesh"):
        name = mesh.get("filename", "")
        file = mesh_path(model, name)
        if file is not None and is_file(file):
            if _is_empty(file):
                raise element_error(
                    mesh, f"mesh {name!r}: {shown_path(file)} is empty: no triangle"
                )
        elif mesh in colliding:
            advice = "name the folder with its package in urdf.packages or ROS_PACKAGE_PATH"
            if file is not None:
                advice = f"copy it to {shown_path(file)}"
            raise element_error(mesh, f"mesh {name!r} does not exist; {advice}")


def _is_empty(file: Path) -> bool:
    """Return whether a mesh file has no triangle, if that is easily found, or no byte."""
    content = read_input(file)
    if file.suffix.lower() == ".stl":
        return b"facet" not in content and len(content) < _ONE_TRIANGLE
    if file.suffix.lower() == ".obj":
        return not any(line.split(maxsplit=1)[:1] == [b"f"] for line in content.splitlines())
    return not content.strip()


def mesh_corners(model: UrdfModel, collision: UrdfCollision) -> Array:
    """Return the corners (N, 3) [m] of the triangles of a mesh that collides, in its own axes.

    Raises:
        ConfigError: the mesh cannot be read, or is so large that its scale must be wrong.

    """
    name = collision.shape.get("filename", "")
    scale = attribute_numbers(collision.shape, "scale", [1.0, 1.0, 1.0])
    try:
        corners = _triangles(mesh_path(model, name) or Path(name)).reshape(-1, 3) * scale
    except ConfigError as error:
        raise element_error(collision.shape, f"mesh {name!r}: {error}") from None
    size = float(np.ptp(corners, axis=0).max())
    if size > _MAX_SIZE:
        what = f'mesh {name!r} is {size:g} m large: give scale="0.001 0.001 0.001" if it is in mm'
        raise element_error(collision.shape, what)
    return corners


@cached_by_files(64)
def _triangles(file: Path) -> Array:
    return read_triangles(file, _MAX_TRIANGLES)


def loadable_urdf(model: UrdfModel, folder: Path) -> Path:
    """Write a file to ``folder`` that PyBullet can load, with its meshes; return its path.

    It names meshes by absolute paths; those that collide become binary STL files, as PyBullet drops
    those of text, unless they are OBJ files. It has no visuals if any mesh is missing, and nothing
    else that PyBullet would refuse.
    """
    root = copy.deepcopy(model.root)
    root.set("name", root.get("name") or "robot")
    files = {
        mesh: mesh_path(model, mesh.get("filename", "")) for mesh in root.iterfind("link//mesh")
    }
    for mesh, file in files.items():
        mesh.set("filename", str(file))
    meshes = [collision for collision in model.collisions if collision.shape.tag == "mesh"]
    for number, mesh in enumerate(root.iterfind("link/collision/geometry/mesh")):
        if Path(mesh.get("filename", "")).suffix.lower() != ".obj":
            corners = mesh_corners(model, meshes[number]).reshape(-1, 3, 3)
            mesh.set("scale", "1 1 1")
            mesh.set("filename", str(folder / f"{number}.stl"))
            (folder / f"{number}.stl").write_bytes(_binary_stl(corners))
    complete = all(file is not None and is_file(file) for file in files.values())
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            if not (complete and is_shaped(visual)):
                link.remove(visual)
    for joint in root.findall("joint"):
        for dynamics in joint.findall("dynamics"):
            if not {"damping", "friction"} & set(dynamics.keys()):
                joint.remove(dynamics)
    indent(root)  # PyBullet breaks lines after 8192 characters, within numbers as well
    written = folder / "robot.urdf"
    written.write_bytes(tostring(root))
    return written


def _binary_stl(corners: Array) -> bytes:
    """Return the content of an STL file of triangles (M, 3, 3)."""
    facets = np.zeros(len(corners), [("normal", "<f4", 3), ("at", "<f4", (3, 3)), ("end", "<u2")])
    facets["at"] = corners
    return bytes(80) + np.uint32(len(corners)).tobytes() + facets.tobytes()
