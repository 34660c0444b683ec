"""Mesh files of a URDF: where they are, their points, and the file that PyBullet loads."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from navfw.config.foreign_files import element_error
from navfw.config.input_file import cached_by_files, is_file, is_folder, shown_path
from navfw.config.lookup import package_folders, package_roots
from navfw.errors import ConfigError
from navfw.meshes import read_triangles
from navfw.numerics import Array
from navfw.robot.urdf_model import (
    UrdfModel,
    attribute_numbers,
    is_shaped,
)

_PACKAGE, _FILE = re.compile("(package|model)://"), "file://"
"""Prefixes of the names of meshes: in a package of ROS, and at an absolute path."""
_MAX_TRIANGLES = 500_000  # chosen
"""Largest number of triangles of a mesh."""
_MAX_SIZE = 20.0  # chosen
"""Largest extent of a robot's mesh [m]: one of 30 cm in millimetres is 300 m large."""


def mesh_file(model: UrdfModel, mesh: Element) -> Path:
    """Find the file of a <mesh>.

    Raises:
        ConfigError: it does not exist; the message says where it belongs.

    """
    name, advice = mesh.get("filename", ""), ""
    paths = [model.file.parent / name.removeprefix(_FILE)]
    if prefix := _PACKAGE.match(name):
        package, _, rest = name[prefix.end() :].partition("/")
        folders = package_folders(package, package_roots(model.file, model.packages))
        paths = [folder / rest for folder in folders if is_folder(folder)]
        advice = "name the folder with its package in urdf.packages or ROS_PACKAGE_PATH"
    for path in paths:
        if is_file(path):
            return path
    advice = f"copy it to {shown_path(paths[0])}" if paths else advice
    raise element_error(mesh, f"mesh {name!r} does not exist; {advice}")


def mesh_corners(model: UrdfModel, mesh: Element) -> Array:
    """Read the corners (N, 3) [m] of the triangles of a <mesh>, in its own axes.

    Raises:
        ConfigError: it does not exist, cannot be read, or is so large that its scale is wrong.

    """
    file, name = mesh_file(model, mesh), mesh.get("filename", "")
    scale = attribute_numbers(mesh, "scale", [1.0, 1.0, 1.0])
    try:
        corners = _triangles(file).reshape(-1, 3) * scale
    except ConfigError as error:
        raise element_error(mesh, f"mesh {name!r}: {error}") from None
    size = float(np.ptp(corners, axis=0).max())
    if size > _MAX_SIZE:
        what = f'mesh {name!r} is {size:g} m large: give scale="0.001 0.001 0.001" if it is in mm'
        raise element_error(mesh, what)
    return corners


@cached_by_files(64)
def _triangles(file: Path) -> Array:
    return read_triangles(file, _MAX_TRIANGLES)


def loadable_urdf(model: UrdfModel, folder: Path) -> Path:
    """Write a file to ``folder`` that PyBullet can load, with its meshes; return its path.

    Meshes are binary STL files, or OBJ files where they are: others end PyBullet, or are dropped.
    What is only seen is left out if it cannot be read: no camera sees its own robot.
    """
    root = copy.deepcopy(model.root)
    root.set("name", root.get("name") or "robot")
    for link in root.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            try:
                _make_loadable(model, part, folder)
            except ConfigError:
                if part.tag == "collision":
                    raise
                link.remove(part)
    for joint in root.findall("joint"):
        for dynamics in joint.findall("dynamics"):
            if not {"damping", "friction"} & set(dynamics.keys()):
                joint.remove(dynamics)
    indent(root)  # PyBullet breaks lines after 8192 characters, within numbers as well
    written = folder / "robot.urdf"
    written.write_bytes(tostring(root))
    return written


def _make_loadable(model: UrdfModel, part: Element, folder: Path) -> None:
    """Name the mesh of a <visual> or <collision> by a file for PyBullet; raise where none is."""
    if not is_shaped(part):
        raise element_error(part, "has no shape that PyBullet knows")
    for mesh in part.iterfind("geometry/mesh"):
        corners, file = mesh_corners(model, mesh), mesh_file(model, mesh)
        if file.suffix.lower() != ".obj":
            file = folder / f"{len(list(folder.iterdir()))}.stl"
            file.write_bytes(_binary_stl(corners.reshape(-1, 3, 3)))
            mesh.set("scale", "1 1 1")
        mesh.set("filename", str(file))


def _binary_stl(corners: Array) -> bytes:
    """Return the content of an STL file of triangles (M, 3, 3)."""
    facets = np.zeros(len(corners), [("normal", "<f4", 3), ("at", "<f4", (3, 3)), ("end", "<u2")])
    facets["at"] = corners
    return bytes(80) + np.uint32(len(corners)).tobytes() + facets.tobytes()
