"""The same mission and seed give the same commands, whatever surrounds the process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from navfw.missions import prepare
from navfw.suite import SuiteFolder

MISSION = ("paper-room", "through-the-door")
SEED = 11
TIMEOUT = "mission.timeout=4"
NAVFW = [sys.executable, "-c", "from navfw.cli import main; main()"]
SUITE = """\
description: one short run
entries:
  - {world: paper-room, missions: [through-the-door]}
"""
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA")

Settings = dict[str, str]

ALONE: dict[str, Settings] = {
    "hash seed 0": {"PYTHONHASHSEED": "0"},
    "hash seed 1": {"PYTHONHASHSEED": "1"},
    "random hash seed": {"PYTHONHASHSEED": "random"},
    "one thread": {f"{library}_NUM_THREADS": "1" for library in THREADS},
    "two threads": {f"{library}_NUM_THREADS": "2" for library in THREADS},
    "plain locale": {"LC_ALL": "C", "PYTHONUTF8": "0"},
    "German locale": {"LC_ALL": "de_DE.UTF-8"},
    "Turkish locale": {"LC_ALL": "tr_TR.UTF-8"},
    "time zone": {"TZ": "Asia/Kathmandu"},
}
"""Environment variables, one variation at a time; where a locale is not installed, C is used."""

TOGETHER: dict[str, Settings] = {
    "first": {**ALONE["hash seed 0"], **ALONE["one thread"], **ALONE["plain locale"]},
    "second": {**ALONE["random hash seed"], **ALONE["two threads"], **ALONE["time zone"]},
}
"""Several variations at once."""


@pytest.fixture(scope="module")
def expected() -> str:
    """The hash of the run in this process, which has driven other missions before."""
    other = prepare(*MISSION, seed=SEED + 1, overrides=["mission.timeout=1"]).run()
    usual = prepare(*MISSION, seed=SEED, overrides=[TIMEOUT]).run().run.log
    assert usual.command_hash != other.run.log.command_hash
    assert len(usual.command_hash) == 64
    assert len({tuple(row) for row in usual.command_stream[:, 1:]}) > 20  # it does drive
    return usual.command_hash


def hash_of_process(folder: Path, settings: Settings, *words: str) -> str:
    """The hash that ``navfw run --json`` prints in a new process in ``folder``."""
    command = ["run", *MISSION, "--seed", str(SEED), "--set", TIMEOUT, "--json", *words]
    done = subprocess.run(  # noqa: S603 - this Python, words of our own
        [*NAVFW, *command],
        cwd=folder,
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 1, done.stderr  # 4 s are too short: a run that fails
    return str(json.loads(done.stdout)["command_hash"])


@pytest.mark.thorough
@pytest.mark.parametrize("name", TOGETHER)
def test_the_commands_are_those_of_any_other_process(
    name: str, expected: str, tmp_path: Path
) -> None:
    folder = tmp_path / f"{name} folder ä"
    folder.mkdir()
    words = ("--record", "--quiet") if name == "first" else ("--out", str(tmp_path / "out"))
    assert hash_of_process(folder, TOGETHER[name], *words) == expected


@pytest.mark.slow
@pytest.mark.parametrize("settings", ALONE.values(), ids=ALONE)
def test_no_variable_of_the_environment_changes_the_commands(
    settings: Settings, expected: str, tmp_path: Path
) -> None:
    assert hash_of_process(tmp_path, settings) == expected


@pytest.mark.slow
def test_the_commands_of_the_stack_floor_plan_are_the_same_in_every_process(tmp_path: Path) -> None:
    office = ["office", "lobby-to-lab", "--stack", "floor_plan", "--set", "mission.timeout=30"]
    hashes = set()
    for _ in range(4):
        command = [*NAVFW, "run", *office, "--json", "--quiet"]
        done = subprocess.run(  # noqa: S603 - this Python, words of our own
            command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        hashes.add(json.loads(done.stdout)["command_hash"])
    assert len(hashes) == 1


@pytest.mark.slow
def test_the_commands_of_a_suite_s_workers_are_the_same(expected: str, tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(SUITE)
    words = ["suite", "short.yaml", "--seeds", f"{SEED}:{SEED + 1}", "--set", TIMEOUT]
    subprocess.run(  # noqa: S603 - this Python, words of our own
        [*NAVFW, *words, "--workers", "2", "--out", "table"],
        cwd=tmp_path,
        capture_output=True,
        timeout=300,
        check=False,
    )
    (row,) = SuiteFolder(tmp_path / "table").rows()
    assert row.command_hash == expected
