"""Mesh files: what is read, and what is refused with file, line and remedy."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cli_calls import put_file

from navfw.errors import ConfigError
from navfw.meshes import mesh_file
from navfw.meshes.mesh_file import MAX_TRIANGLES, TriangleMesh, read_mesh

POINTS = "".join(f"v {x} {y} {z}\n" for z in (0, 2) for x, y in ((0, 0), (3, 0), (3, 1), (0, 1)))
SIDES = ("1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8")
FACES = ("4 3 2 1", "5 6 7 8", *SIDES)


def with_faces(*faces: str) -> str:
    """An .obj file of the points with these faces."""
    return POINTS + "".join(f"f {face}\n" for face in faces)


BOX = with_faces(*FACES)
"""A box of 3 x 1 x 2."""


def mesh_of(folder: Path, content: str | bytes, name: str = "thing.obj") -> TriangleMesh:
    return read_mesh(put_file(folder, name, content))


def is_box(mesh: TriangleMesh) -> bool:
    """Whether ``mesh`` has the corners, faces and volume of the box."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    return (len(mesh.vertices), len(mesh.faces), round(volume, 5)) == (8, 12, 6.0)


@pytest.mark.parametrize(
    "text",
    [
        BOX,
        with_faces(*(f"{face.replace(' ', '/1/1 ')}/1/1" for face in FACES)),
        with_faces(*(" ".join(str(int(i) - 9) for i in face.split()) for face in FACES)),
        "mtllib a.mtl\no box\n# words\nvt 0 0\nvn 0 0 1\n" + BOX + "l 1 2\n",
    ],
    ids=["plain", "slashes", "negative", "with what is not read"],
)
def test_obj_polygons_become_triangles(tmp_path: Path, text: str) -> None:
    assert is_box(mesh_of(tmp_path, text))


def test_binary_and_ascii_stl_are_the_same_mesh(tmp_path: Path) -> None:
    corners = mesh_of(tmp_path, BOX).corners
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in corners)
    # many exporters begin the 80 bytes of a binary file's header with "solid"
    binary = b"solid box".ljust(80) + struct.pack("<I", len(corners)) + records
    text = "solid box\n"
    for triangle in corners:
        points = "".join(f"vertex {x:e} {y:e} {z:e}\n" for x, y, z in triangle)
        text += f"facet normal 0 0 0\nouter loop\n{points}endloop\nendfacet\n"
    text += "endsolid box\n"
    for name, content in (("b.stl", binary), ("a.STL", text.encode())):
        assert is_box(mesh_of(tmp_path, content, name))


CONCAVE = "v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\nf 2 3 4 1\n"


@pytest.mark.parametrize(
    ("content", "line", "message"),
    [
        (with_faces(*FACES[1:]), None, "open: 4 edges .* close its holes"),
        (BOX.replace("f 5 6 7 8", "f 8 7 6 5"), None, "turned inside out; make their normals"),
        (
            with_faces(*(" ".join(reversed(face.split())) for face in FACES)),
            None,
            "encloses no volume, or its faces are turned inside out; flip",
        ),
        (BOX + "f 1 2 99\n", 15, "number of a vertex from 1 to 8, got '99'"),
        (BOX + "f 1 x 3\n", 15, "from 1 to 8, got 'x'"),
        (BOX + "f 1 2\n", 15, "at least 3 vertices, got 2"),
        ("v 0 nan 1\n" + BOX, 1, "expected the x, y and z of a vertex, got '0 nan 1'"),
        ("v 0 1\n" + BOX, 1, "expected the x, y and z"),
        (CONCAVE, 5, "the face is concave; triangulate"),
        (BOX + "cstype bezier\n", 15, "curved surfaces are not supported; export triangles"),
        ("v 1e7 0 0\n" + POINTS + "f 1 2 3\n", None, "coordinates beyond 1e6"),
        ("# nothing\n", None, "has no triangles; export"),
        (POINTS + "f 1 2 3\n" * (MAX_TRIANGLES + 1), None, "more than 20000 triangles; simplify"),
    ],
)
def test_obj_files_that_cannot_be_used(
    tmp_path: Path, content: str, line: int | None, message: str
) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        mesh_of(tmp_path, content)
    assert str(caught.value.file).endswith("thing.obj")
    assert caught.value.line == line


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"\0" * 200, "a.stl: .*; export the mesh again"),
        ("a.stl", b"solid a\nvertex 0 0 0\nvertex 1 0 0\n", "a.stl: .*; export the mesh again"),
        ("a.stl", b"solid a\nvertex 0 0 zero\n", "a.stl: .*; export the mesh again"),
        (
            "a.stl",
            b"\0" * 80 + struct.pack("<I", MAX_TRIANGLES + 1) + bytes(50 * (MAX_TRIANGLES + 1)),
            "more than 20000 triangles",
        ),
        ("a.dae", b"<COLLADA/>", "a.dae: cannot be read as DAE: .*; export"),
        ("a.fbx", b"x", r"expected a mesh \(.dae, .obj, .stl\), got 'a.fbx'; export"),
    ],
)
def test_other_files_that_cannot_be_used(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        mesh_of(tmp_path, content, name)


def test_a_format_is_one_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    corners = mesh_of(tmp_path, BOX).corners
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    monkeypatch.setitem(mesh_file._READERS, ".ply", mesh_file._by_trimesh)
    for name in ("thing.ply", "thing.dae"):
        trimesh.Trimesh(corners.reshape(-1, 3), faces).export(tmp_path / name)
        assert is_box(read_mesh(tmp_path / name))
