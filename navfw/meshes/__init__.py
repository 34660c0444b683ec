"""Triangle meshes from files, of bounded size: furniture of a world, collision shapes to import.

``mesh_file`` reads all formats; ``furniture_mesh`` scales a mesh, or a URDF's shapes, to metres;
``mesh_outline`` covers one with boxes for plans. ``triangle_mesh`` has sections and surfaces,
``section_grid`` draws sections on cells.
"""

from __future__ import annotations

from navfw.meshes.furniture_mesh import furniture_mesh, furniture_outline
from navfw.meshes.mesh_file import MESH_SUFFIXES, MeshLimits, read_mesh, read_triangles
from navfw.meshes.mesh_outline import OutlineBox
from navfw.meshes.triangle_mesh import TriangleMesh

__all__ = [
    "MESH_SUFFIXES",
    "MeshLimits",
    "OutlineBox",
    "TriangleMesh",
    "furniture_mesh",
    "furniture_outline",
    "read_mesh",
    "read_triangles",
]
