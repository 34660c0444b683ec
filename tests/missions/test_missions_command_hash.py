"""The same mission and seed give the same commands, whatever the process and the processor."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from hash_table import WITH_AVX2, WITH_AVX512, Settings, measured_hashes, stored_hashes, threads
from processes import python

from navfw.missions import prepare

MISSION = ("paper-room", "through-the-door")
SEED = 11
TIMEOUT = "mission.timeout=4"
RUN = [*MISSION, "--seed", str(SEED), "--set", TIMEOUT]
NAVFW = "from navfw.cli import main; main()"

TOGETHER: dict[str, Settings] = {
    "first": {"PYTHONHASHSEED": "0", **threads(1), "LC_ALL": "C", "PYTHONUTF8": "0"},
    "second": {"PYTHONHASHSEED": "7", **threads(2), "TZ": "Asia/Kabul", "LC_ALL": "tr_TR.UTF-8"},
}
"""Environment variables, several at once; where a locale is not installed, C is used."""


def hash_in_this_process(world: str, mission: str, seed: int, timeout: str) -> str:
    log = prepare(world, mission, seed=seed, overrides=[timeout]).run().log
    assert len({tuple(row) for row in log.command_stream[:, 1:]}) > 20  # it does drive
    return log.command_hash


@pytest.fixture(scope="module")
def expected() -> str:
    """The hash of the run in this process, which has driven other missions before."""
    other = prepare(*MISSION, seed=SEED + 1, overrides=["mission.timeout=1"]).run()
    usual = hash_in_this_process(*MISSION, SEED, TIMEOUT)
    assert usual != other.log.command_hash
    assert len(usual) == 64
    return usual


def hash_of(folder: Path, settings: Settings, words: Sequence[str] = RUN) -> str:
    """The hash that ``navfw run --json`` prints in a new process in ``folder``."""
    command = ["run", *words, "--json", "--quiet"]
    done = python(NAVFW, *command, cwd=folder, env=settings, timeout=900)
    assert done.returncode == 1, done.stderr  # the time is too short: a run that fails
    return str(json.loads(done.stdout)["command_hash"])


@pytest.mark.thorough
@pytest.mark.parametrize("name", TOGETHER)
def test_the_commands_are_those_of_any_other_process(
    name: str, expected: str, tmp_path: Path
) -> None:
    folder = tmp_path / f"{name} folder ä"
    folder.mkdir()
    words = ("--record",) if name == "first" else ("--out", str(tmp_path / "out"))
    assert hash_of(folder, TOGETHER[name], [*RUN, *words]) == expected


OFFICE = ("office", "lobby-to-lab")
LOBBY = [*OFFICE, "--seed", "2", "--set", "mission.timeout=6"]


@pytest.mark.thorough
def test_a_processor_with_all_that_this_one_has_gives_the_same_commands(tmp_path: Path) -> None:
    here = hash_in_this_process(*OFFICE, 2, "mission.timeout=6")
    assert hash_of(tmp_path, {**WITH_AVX512, **threads(4)}, LOBBY) == here


@pytest.mark.slow
@pytest.mark.parametrize("settings", [WITH_AVX512, WITH_AVX2], ids=["AVX-512", "AVX2"])
def test_all_short_drives_give_the_stored_commands(settings: Settings, tmp_path: Path) -> None:
    assert measured_hashes(tmp_path, settings) == stored_hashes()
