"""Which large libraries a command imports: those that it needs, and no others."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

LARGE = ("cv2", "matplotlib", "networkx", "numba", "numpy", "pybullet", "scipy", "skfuzzy")

COMMAND = """
import contextlib, io, json, sys
from navfw.cli import app
with contextlib.redirect_stdout(io.StringIO()) as shown:
    try:
        app(sys.argv[1].split())
    except SystemExit as end:
        assert not end.code, shown.getvalue()
assert shown.getvalue()
print(json.dumps(sorted(sys.modules)))
"""


def imported_by(command: str) -> set[str]:
    """The large libraries that a process has imported after ``command``."""
    done = subprocess.run(  # noqa: S603 - the interpreter of this test
        [sys.executable, "-c", COMMAND, command], capture_output=True, text=True, check=True
    )
    return set(LARGE) & set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize(
    "command",
    [
        "--version",
        "--help",
        "run --help",
        "list worlds",
        "list missions office",
        "list maps",
        "list plugins",
        "list stacks --json",
    ],
)
def test_help_and_listings_of_files_import_no_large_library(command: str) -> None:
    assert imported_by(command) == set()


def test_the_listing_of_robots_imports_numpy_alone() -> None:
    assert imported_by("list robots") == {"numpy"}


def test_the_listing_of_plugins_imports_neither_simulator_nor_reference_nor_plots() -> None:
    assert imported_by("list plugins --json") & {"pybullet", "skfuzzy", "matplotlib"} == set()
