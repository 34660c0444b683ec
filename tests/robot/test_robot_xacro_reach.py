"""What a xacro file may read, and which mesh files count as empty."""

import struct
from pathlib import Path

import pytest
from cli_calls import put_files

from navfw.errors import ConfigError
from navfw.robot import read_urdf

HEAD = '<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="a"/>'
PART = '<robot><link name="b"/></robot>'
MESH = '<link name="m"><collision><geometry><mesh filename="%s"/></geometry></collision></link>'
TRIANGLE = struct.pack("<12fH", *range(12), 0)


@pytest.fixture
def outside(workdir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, which is not that of the xacro file ``bot/urdf/bot.xacro``."""
    files = {"secret.yaml": "word: hidden\n", "part.xacro": PART, "other/part.xacro": PART}
    put_files(workdir, {**files, "bot/urdf/sub/part.xacro": PART, "bot/urdf/size.yaml": "w: c\n"})
    monkeypatch.setenv("SECRET", "hidden")
    return workdir


def links(folder: Path, body: str) -> tuple[str, ...]:
    """The links of a xacro file with ``body``, but for its first one."""
    file = folder / "bot" / "urdf" / "bot.xacro"
    file.write_text(f"{HEAD}{body}</robot>")
    return read_urdf(file).links[1:]


def test_files_beside_the_xacro_file_are_read_from_any_folder(outside: Path) -> None:
    assert links(outside, '<xacro:include filename="sub/part.xacro"/>') == ("b",)
    value = "${xacro.load_yaml('size.yaml')['w']}"
    assert links(outside, f'<link name="{value}"/>') == ("c",)
    assert links(outside, '<link name="$(optenv SECRET none)"/>') == ("none",)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<link name="$(env SECRET)"/>', "env SECRET"),
        ('<link name="$(find etc)"/>', "package 'etc' not found"),
        ('<link name="$(find ../../../other)"/>', "not found"),
        ('<xacro:include filename="$(find other)/part.xacro"/>', "package 'other' not found"),
        ('<xacro:include filename="../../part.xacro"/>', "lies in no package"),
        ("<link name=\"${xacro.load_yaml('%s/secret.yaml')['word']}\"/>", "lies in no package"),
    ],
)
def test_nothing_else_is_read(outside: Path, body: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as error:
        links(outside, body.replace("%s", str(outside)))
    assert "hidden" not in str(error.value)


def test_a_package_by_its_manifest_is_read(outside: Path) -> None:
    put_files(outside, {"bot/package.xml": "<package/>", "bot/part.xacro": PART})
    assert links(outside, '<xacro:include filename="../part.xacro"/>') == ("b",)
    (outside / "other" / "package.xml").write_text("<package/>")
    assert links(outside, '<xacro:include filename="$(find other)/part.xacro"/>') == ("b",)


@pytest.mark.parametrize(
    ("name", "content", "empty"),
    [
        ("a.stl", b"solid exported".ljust(80) + struct.pack("<I", 2) + 2 * TRIANGLE, False),
        ("a.stl", b"solid exported".ljust(80) + struct.pack("<I", 0), True),
        ("a.stl", b"made".ljust(80) + struct.pack("<I", 2), True),
        ("a.stl", b"solid none" + b" " * 90 + b"\nendsolid none\n", True),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf\t1 2 3\n", False),
        ("a.obj", b"v 0 0 0\n", True),
        ("a.dae", b"", True),
    ],
)
def test_meshes_without_triangles(tmp_path: Path, name: str, content: bytes, empty: bool) -> None:
    (tmp_path / name).write_bytes(content)
    file = tmp_path / "bot.urdf"
    file.write_text(f"{HEAD}{MESH % name}</robot>")
    if not empty:
        assert read_urdf(file).links == ("a", "m")
        return
    with pytest.raises(ConfigError, match=rf"bot.urdf:1: mesh '{name}': .*{name} is empty"):
        read_urdf(file)
