"""What each kind of file may hold at most: bytes, and what a parser makes of them.

This is the only place of these bounds. ``navfw.config.input_file`` checks bytes before anything is
read; the parser of a kind checks items, depth and seconds while, or before, it builds anything. The
table in ``docs/robustness.md`` is written from it.
"""

from __future__ import annotations

from typing import NamedTuple

MAX_DEPTH = 60
"""Largest nesting of lists, mappings, elements and dotted keys, in files of all kinds."""


class InputBounds(NamedTuple):
    """Largest size of a file [byte], and number of ``items`` in it, which ``unit`` names.

    ``seconds`` is the longest time of a parser that is not bounded by these.
    """

    max_bytes: int
    items: int = 0
    unit: str = ""
    seconds: float = 0.0


_NODES = "keys and values"
INPUT_BOUNDS = {
    "YAML": InputBounds(1_000_000, 40_000, _NODES),  # 2 to 4 s
    "map": InputBounds(8_000_000, 300_000, _NODES),  # ten thousand places, half a minute
    "exchanged map": InputBounds(32_000_000, 2_000_000, _NODES),
    "JSON": InputBounds(16_000_000, 2_000_000, _NODES),  # 2 h with 1000 events: 1 MB
    "pyproject.toml": InputBounds(500_000, 100_000, _NODES),
    "recording": InputBounds(1 << 30),  # an hour of 160x120 images at 10 Hz: 0.6 GB
    "chunk of a recording": InputBounds(1 << 26),  # navfw writes 1 MB
    "bag": InputBounds(20_000_000_000, seconds=10.0),
    "chunk of a bag": InputBounds(1 << 28),
    "metadata of a bag": InputBounds(10_000_000, 40_000, _NODES),
    "journal of a suite": InputBounds(400_000_000, 200_000, "runs", 10.0),  # 1 kB a run
    "study": InputBounds(2_000_000_000, seconds=10.0),
    "image": InputBounds(100_000_000, 64_000_000, "pixels"),  # telephones: 12 to 50 megapixels
    "picture of a texture": InputBounds(20_000_000, 4_000_000, "pixels"),  # 4 mm over 8 x 8 m
    "picture of a poster": InputBounds(20_000_000, 64_000_000, "pixels"),
    "picture of a report": InputBounds(5_000_000),
    "video": InputBounds(20_000_000_000, 64_000_000, "pixels a frame"),
    "timed table": InputBounds(50_000_000),  # an hour of poses at 100 Hz
    "mesh of furniture": InputBounds(10_000_000, 20_000, "triangles"),  # each image draws them
    "mesh of a Gazebo world": InputBounds(50_000_000, 500_000, "triangles"),
    "mesh of a URDF": InputBounds(200_000_000),
    "Gazebo world": InputBounds(20_000_000),  # the largest of BARN: 0.7 MB
    "path of BARN": InputBounds(1_000_000, 100_000, "numbers"),
    "URDF": InputBounds(5_000_000),  # that of Husky: 11 kB
    "file that xacro includes": InputBounds(10_000_000, seconds=20.0),
    "benchmark": InputBounds(50_000_000),
    "template or page": InputBounds(2_000_000),
    "files of a job": InputBounds(200_000_000),
    "fingerprinted file": InputBounds(1 << 28),
    "refs of git": InputBounds(64_000_000),  # some hundred thousand
    "stored run of a test": InputBounds(64_000_000),  # 2 h: 45 MB
}
"""The bounds by the kind of file."""


def max_bytes(kind: str) -> int:
    """The largest size of a file of that kind [byte]."""
    return INPUT_BOUNDS[kind].max_bytes
