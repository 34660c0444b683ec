"""Inputs are regular files of bounded size, and all are opened by one function."""

import ast
import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from architecture_sources import MODULES, dotted, shown, tree_of
from cli_calls import put_file

from navfw.config import find
from navfw.config.document import load_yaml
from navfw.config.image_file import read_image
from navfw.config.input_file import (
    is_file,
    is_folder,
    read_input,
    read_input_text,
    read_json_object,
)
from navfw.config.lookup import project_folder
from navfw.errors import ConfigError, InputError
from navfw.perceive.image_sources import open_source
from navfw.perceive.motion_record import load_gyro_record
from navfw.recording import read_result
from navfw.recording.run_replay import load_recording
from navfw.suite import load_suite
from navfw.suite.run_row import RunJournal
from navfw.topomap.map_formats import load_any_map
from navfw.worldgen.sdf_reader import read_sdf

READERS = """
    open read_text read_bytes fromfile loadtxt genfromtxt memmap imread imreadmulti VideoCapture
    loadmat ZipFile parse iterparse
"""
"""Functions that open a file by its name, whatever they belong to."""

LOADERS = {"np.load", "numpy.load", "json.load", "tomllib.load", "pickle.load", "csv.reader"}

ALLOWED = """
    cli/installed_commands.py:file.open
    cli/output.py:os.open
    cli/suite.py:folder.open
    config/image_file.py:PillowImage.open
    config/input_file.py:path.open
    config/installed_packages.py:file.read_text
    config/yaml_text.py:yaml.parse
    perceive/timed_table.py:csv.reader
    perceive/image_sources.py:cv2.VideoCapture
    perceive/webcam.py:cv2.VideoCapture
    plugins/built_in.py:ast.parse
    plugins/simulator_access.py:ast.parse
    process/atomic.py:unfinished.open
    recording/cut_bag.py:target.open
    process/kernel_compilation.py:KERNEL_FILE.read_text
    process/process_resources.py:?.read_text
    process/target_lock.py:os.open
    recording/provenance.py:about.read_text
    recording/run_observers.py:path.open
    recording/video_output.py:av.open
    robot/xacro_expansion.py:ast.parse
    scaffold/new_files.py:installed.read_text
    sim/engine.py:?.open
    suite/dask_engine.py:picture.read_bytes
    suite/dask_engine.py:zipfile.ZipFile
    suite/worker_pool.py:open
    tune/stack_study.py:Objectives.parse
"""
"""Calls of these names that open no input: outputs, devices, packages, and what is read already."""


def opening_calls(path: Path) -> set[str]:
    calls = set()
    for node in ast.walk(tree_of(path)):
        if not isinstance(node, ast.Call):
            continue
        name = dotted(node.func)
        last = node.func.attr if isinstance(node.func, ast.Attribute) else name
        if last in READERS.split() or name in LOADERS:
            calls.add(name or f"?.{last}")
    return calls


def test_no_other_module_opens_an_input() -> None:
    calls = {f"{shown(path)}:{call}" for path in MODULES for call in opening_calls(path)}
    assert calls - {f"navfw/{call}" for call in ALLOWED.split()} == set(), (
        "read inputs with navfw.config.input_file"
    )


def to_zero(path: Path) -> None:
    path.symlink_to("/dev/zero")


Read = Callable[[Path], object]

INPUTS: dict[str, tuple[str, Read]] = {
    "yaml": ("a.yaml", load_yaml),
    "world": ("world.yaml", lambda path: find("world", path)),
    "suite": ("a.yaml", load_suite),
    "map": ("a.yaml", load_any_map),
    "graphml": ("a.graphml", load_any_map),
    "geojson": ("a.geojson", load_any_map),
    "json": ("a.json", read_json_object),
    "result": ("result.json", lambda path: read_result(path.parent)),
    "recording": ("run.mcap", load_recording),
    "journal": ("journal.sqlite", lambda path: RunJournal(path).rows(())),
    "gyro": ("gyro.csv", load_gyro_record),
    "image": ("a.png", read_image),
    "video": ("a.mp4", lambda path: open_source([path])),
    "sdf": ("a.world", read_sdf),
}


@pytest.mark.parametrize("kind", INPUTS)
def test_a_pipe_device_socket_or_folder_is_refused_at_once(kind: str, tmp_path: Path) -> None:
    name, read = INPUTS[kind]
    for number, make in enumerate((os.mkfifo, to_zero, listen, os.mkdir)):
        place = tmp_path / str(number)
        place.mkdir()
        make(place / name)
        with pytest.raises(InputError, match=name) as raised:
            read(place / name)
        assert raised.value.file is not None


def listen(path: Path) -> None:
    with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as server:
        server.bind(path.name)  # names of sockets are short


@pytest.mark.parametrize("kind", [kind for kind in INPUTS if kind != "result"])
@pytest.mark.parametrize("name", ["x" * 300, "a\0b", "\udcff"])
def test_a_name_that_no_file_has_is_refused(kind: str, name: str, tmp_path: Path) -> None:
    suffix, read = Path(INPUTS[kind][0]).suffix, INPUTS[kind][1]
    with pytest.raises(ConfigError, match=r"no such file|cannot read"):
        read(tmp_path / f"{name}{suffix}")
    assert not is_file(tmp_path / name)
    assert not is_folder(tmp_path / name)


def test_a_file_is_read_up_to_its_bound_and_through_a_link(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(put_file(tmp_path, "file", b"12345").name)
    assert read_input(link, 5) == b"12345"
    with pytest.raises(ConfigError, match="too large: at most 4 bytes"):
        read_input(link, 4)


def test_text_is_utf_8_with_or_without_a_mark(tmp_path: Path) -> None:
    file = put_file(tmp_path, "a.txt", b"\xef\xbb\xbfone\ntwo")
    assert read_input_text(file, 100) == "one\ntwo"
    file.write_bytes(b"\xef\xbb\xbfone\nt\xffwo")
    with pytest.raises(ConfigError, match=r"a\.txt:2: expected UTF-8 text, got byte 0xff"):
        read_input_text(file, 100)


def test_what_is_no_regular_file_makes_no_project(tmp_path: Path) -> None:
    to_zero(tmp_path / "pyproject.toml")
    assert project_folder(tmp_path) is None


def test_a_picture_with_a_damaged_chunk_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    file = tmp_path / "chunk.png"
    assert cv2.imwrite(str(file), np.zeros((8, 8), dtype=np.uint8))
    content = file.read_bytes()
    assert read_image(file).shape == (8, 8, 3)
    at = content.index(b"IDAT") - 4
    file.write_bytes(content[:at] + b"\x3f\0\0\0" + content[at + 4 :])
    with pytest.raises(ConfigError, match="not a readable image"):
        read_image(file)


def test_a_picture_of_many_pixels_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="too large: 9000 x 9000"):
        read_image(put_file(tmp_path, "bomb.pgm", b"P5 9000 9000 255\n" + b"\0" * 100))
