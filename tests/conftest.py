"""Settings for all tests."""

import gc
import os
import signal
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest
import typer.testing
from hypothesis import settings

# as the command does: looking for garbage takes a twentieth of the time
gc.set_threshold(50_000, 20, 100)

# examples are the same in every run, and a loaded machine is no failure
settings.register_profile("navfw", deadline=None, derandomize=True)
settings.load_profile("navfw")

# Typer's test runner would build the tree of commands for every call: 25 ms
typer.testing._get_command = cache(typer.testing._get_command)  # type: ignore[attr-defined]

# a shell that starts tests in the background has them ignore Ctrl-C, and all that they start, too
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# the tests make projects with plugins in temporary folders
os.environ["NAVFW_TRUST"] = "1"

COVERED = frozenset(
    [
        "behaviors",
        "camera_geometry",
        "context",
        "egomotion",
        "features",
        "flow",
        "fuzzy",
        "guard",
        "localization",
        "localmap",
        "locom",
        "mofis",
        "movers",
        "offis",
        "papfis",
        "safety",
        "stack",
        "topomap",
    ]
)
"""Rooms whose tests count for the coverage of the robot's rooms; tracing doubles their time."""


def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    """Switch off tracing for tests that have nothing to cover; with --cov alone."""
    tests = Path(__file__).parent
    for item in items:
        if item.path.relative_to(tests).parts[0] not in COVERED:
            item.add_marker("no_cover")


@pytest.fixture
def workdir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
