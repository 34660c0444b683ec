"""The same mission and seed give the same commands on every x86-64 processor with AVX2."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hash_table import WITH_AVX2, WITH_AVX512, Settings, measured_hashes, stored_hashes, threads

from navfw.missions import prepare

MISSION = ("office", "lobby-to-lab")
TIMEOUT = "mission.timeout=6"
RUN = ["run", *MISSION, "--seed", "2", "--set", TIMEOUT, "--json", "--quiet"]
LOADED = "from navfw.cli import main; main()"
COMPILED_HERE = f"""
from navfw.process import listed_kernels
from navfw.missions.session_setup import prepare
prepare(*{MISSION})
for kernel in listed_kernels(loaded=True):
    kernel.compile()
{LOADED}
"""
"""A process that drives with what it has compiled itself; other processes load it from a file."""


@pytest.fixture(scope="module")
def expected() -> str:
    """The hash of the run in this process."""
    log = prepare(*MISSION, seed=2, overrides=[TIMEOUT]).run().run.log
    assert len({tuple(row) for row in log.command_stream[:, 1:]}) > 20  # it does drive
    return log.command_hash


def hash_of(program: str, folder: Path, settings: Settings) -> str:
    done = subprocess.run(  # noqa: S603 - this Python, words of our own
        [sys.executable, "-c", program, *RUN],
        cwd=folder,
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 1, done.stderr  # 6 s are too short: a run that fails
    return str(json.loads(done.stdout)["command_hash"])


@pytest.mark.thorough
def test_a_processor_with_avx2_alone_gives_the_same_commands(expected: str, tmp_path: Path) -> None:
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    compiled = hash_of(COMPILED_HERE, tmp_path, {**WITH_AVX2, **cache, **threads(4)})
    loaded = hash_of(LOADED, tmp_path, {**WITH_AVX2, **cache, **threads(1)})
    assert compiled == loaded == expected


@pytest.mark.thorough
def test_a_processor_with_all_that_this_one_has_gives_the_same_commands(
    expected: str, tmp_path: Path
) -> None:
    assert hash_of(LOADED, tmp_path, {**WITH_AVX512, **threads(4)}) == expected


@pytest.mark.slow
@pytest.mark.parametrize("library", ["NUMBA", "OPENBLAS", "NPY", "OPENCV"])
def test_each_library_alone_gives_the_same_commands(
    library: str, expected: str, tmp_path: Path
) -> None:
    settings = {key: value for key, value in WITH_AVX2.items() if key.startswith(library)}
    assert hash_of(LOADED, tmp_path, settings) == expected


@pytest.mark.slow
@pytest.mark.parametrize("settings", [WITH_AVX512, WITH_AVX2], ids=["AVX-512", "AVX2"])
def test_all_short_drives_give_the_stored_commands(settings: Settings, tmp_path: Path) -> None:
    assert measured_hashes(tmp_path, settings) == stored_hashes()
