"""Mission tests beyond the marker: mission files, the cache, faults, seeds, reports."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from navfw.config import shipped_folder
from navfw.missions import MissionResult, draw, prepare
from navfw.testing import driven_run, mission_cache, mission_run
from navfw.testing.driven_run import FILES, DrivenRun, read_run, store_run
from navfw.testing.mission_case import MissionCase

pytest_plugins = "pytester"

MARKED = """
import pytest

@pytest.mark.mission(world="empty", mission="straight", set={"mission.timeout": 1.5})
def test_it(mission):
"""
FAULTY = '''
from typing import ClassVar
from navfw import Behavior, Context, Proposal

class Hover(Behavior):
    """Fails."""

    name: ClassVar[str] = "hover"

    def propose(self, context: Context) -> Proposal:
        return 1 / 0
'''


@pytest.fixture(scope="module", autouse=True)
def _everything_imported(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Pytester removes modules imported inside it, and numpy cannot be imported twice."""
    result = prepare("empty", "straight", overrides=["mission.timeout=1.5"]).run()
    draw(result, tmp_path_factory.mktemp("warm") / "trajectory.png")


@pytest.fixture
def drives(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The missions that are driven, in order."""
    driven: list[str] = []

    def drive(case: MissionCase) -> MissionResult:
        driven.append(case.label)
        return original(case)

    original = driven_run.drive
    for module in (mission_run, mission_cache):
        monkeypatch.setattr(module, "drive", drive)
    return driven


def section(done: pytest.RunResult, name: str) -> str:
    """The value of a line ``name: value`` of the report."""
    (line,) = [line for line in done.outlines if line.startswith(f"{name}: ")]
    return line.removeprefix(f"{name}: ")


@pytest.mark.thorough
def test_an_unchanged_mission_is_driven_once(pytester: pytest.Pytester, drives: list[str]) -> None:
    place = pytester.path / "worlds" / "hall"
    shutil.copytree(shipped_folder() / "worlds" / "empty", place)
    (pytester.path / "navfw.toml").touch()
    text = MARKED.replace("empty", "hall")
    pytester.makepyfile(text + "    assert mission.outcome == 'timeout' and not mission.cached")
    pytester.runpytest_inprocess().assert_outcomes(passed=1)
    pytester.makepyfile(text + "    assert mission.cached and mission.seed")
    first = pytester.runpytest_inprocess()
    first.assert_outcomes(failed=1)
    assert drives == ["straight-seed0"] * 2, "again for the recording of the failed test"
    assert "taken from pytest's cache" in first.stdout.str()
    again = pytester.runpytest_inprocess()
    assert len(drives) == 2, "its run folder is in the cache, too"
    for done in (first, again):
        assert Path(section(done, "picture")).read_bytes()[:4] == b"\x89PNG"
        assert Path(section(done, "recording")).stat().st_size > 1000
    pytester.runpytest_inprocess("--mission-fresh")
    assert len(drives) == 3
    mission = place / "missions" / "straight.yaml"
    (place / "missions" / "other.yaml").write_text("changed: too")
    pytester.runpytest_inprocess()
    assert len(drives) == 3, "no file of this mission has changed"
    mission.write_text(mission.read_text() + "# changed\n")
    pytester.runpytest_inprocess()
    assert len(drives) == 4


def test_a_mission_file_is_a_test(pytester: pytest.Pytester) -> None:
    place = pytester.path / "worlds" / "empty" / "missions"
    place.mkdir(parents=True)
    (pytester.path / "navfw.toml").touch()
    mission = "start: [1, 2, 0]\ngoals: [{x: 1.9, y: 2}]\ntimeout: 20\nsuccess: {within: 1.5}\n"
    (place / "near.yaml").write_text(mission + "tolerance: 1.0\n")
    (place / "far.yaml").write_text(mission.replace("20", "1"))
    (place / "wrong.yaml").write_text(mission + "stack: defalt\n")
    options = ("-p", "no:cacheprovider", "worlds")
    pytester.runpytest_inprocess(*options).assert_outcomes()
    pytester.makeini("[pytest]\nnavfw_missions =\n  worlds/*/missions/*r.yaml\n")
    done = pytester.runpytest_inprocess(*options, "--mission-seeds", "0:2")
    done.assert_outcomes(passed=2, failed=2)
    done.stdout.fnmatch_lines(
        [
            "expected the goal to be reached; timeout after 1.0 s*",
            "stack:   default (neither test nor mission names one)",
        ]
    )
    done = pytester.runpytest_inprocess(*options, "-o", "navfw_missions=missions/wrong.yaml")
    done.assert_outcomes(errors=1)
    assert "did you mean 'default'?" in done.stdout.str()


def test_reports_carry_the_run(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(MARKED + "    assert mission.outcome == 'reached'")
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider", "--junit-xml", "report.xml")
    tree = ElementTree.parse(pytester.path / "report.xml")  # noqa: S314 - written by pytest
    found = {p.get("name"): str(p.get("value")) for p in tree.iter("property")}
    assert found["outcome"] == "timeout"
    assert "1.5 s" in found["reason"]
    assert (found["stack"], found["seed"], len(found["command_hash"])) == ("default", "0", 64)
    assert found["picture"] == section(done, "picture")
    assert found["recording"] == section(done, "recording")
    done.stdout.fnmatch_lines(
        ["the last decisions:", "*leads", "the last command:", "  at *led by*"]
    )


def test_a_fault_of_a_plugin_fails_the_test(pytester: pytest.Pytester) -> None:
    (pytester.path / "behaviors").mkdir()
    (pytester.path / "navfw.toml").touch()
    (pytester.path / "behaviors" / "hover.py").write_text(FAULTY)
    marker = '@pytest.mark.mission("empty", "straight", set=["mission.timeout=1.5"'
    tests = (
        f"{marker}, 'behaviors.hover='])\ndef test_a(mission):\n    assert mission.faults\n"
        f"{marker}, 'behaviors.hover='], allow_faults=True)\n"
        "def test_b(mission):\n    assert 'in propose: return 1 / 0' in mission.faults[0]"
    )
    pytester.makepyfile("import pytest\n" + tests)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(passed=1, failed=1)
    fault = "behavior hover: ZeroDivisionError: division by zero (behaviors/hover.py:11, in propose"
    done.stdout.fnmatch_lines(
        ["a plugin faulted; *allow_faults=True*", f"  {fault}: return 1 / 0) (*first at*"]
    )


def test_more_seeds_widen_every_mission(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(MARKED + "    pass")
    options = ("-p", "no:cacheprovider", "--collect-only", "-q")
    done = pytester.runpytest_inprocess(*options, "--mission-seeds", "0:3")
    assert [line for line in done.outlines if "straight" in line] == [
        f"test_more_seeds_widen_every_mission.py::test_it[straight-seed{seed}]" for seed in range(3)
    ]
    done = pytester.runpytest_inprocess(*options, "--mission-seeds", "3")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(["*--mission-seeds: expected A:B*"])


def test_the_stack_of_the_mission_counts_unless_the_test_names_one(
    pytester: pytest.Pytester,
) -> None:
    marker = '@pytest.mark.mission("office", "patrol", set="mission.timeout=1"'
    text = f"{marker})\ndef test_a(mission):\n    assert mission.stack == 'default'\n"
    text += f"{marker}, stack='default')\ndef test_b(mission):\n    assert mission.stack == ''\n"
    pytester.makepyfile("import pytest\n" + text)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(failed=2)
    done.stdout.fnmatch_lines(["stack:   landmarks (named by the mission)"])
    done.stdout.fnmatch_lines(["stack:   default (named by the test)"])


def test_a_stored_run_is_the_same(tmp_path: Path) -> None:
    result = prepare("empty", "straight", overrides={"mission.timeout": 1.5}).run()
    run = DrivenRun.of(result)
    store_run(run, tmp_path)
    read = read_run(tmp_path)
    assert read is not None
    assert read.log.command_hash == result.run.log.command_hash
    assert read.metrics == result.metrics
    assert (read.verdict, read.log.waypoints) == (result.run.verdict, result.run.log.waypoints)
    assert np.array_equal(read.log.leader, result.run.log.leader)
    for name in FILES:
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
        assert read_run(tmp_path) is None
        (tmp_path / name).write_bytes(whole)
    assert read_run(tmp_path / "none") is None


@pytest.mark.slow
def test_workers_of_xdist_share_the_runs(pytester: pytest.Pytester) -> None:
    text = (
        MARKED + "    with open('driven', 'a') as file:\n        print(mission.cached, file=file)"
    )
    pytester.makepyfile(test_a=text, test_b=text)
    pytester.runpytest_subprocess("-n", "2", "--dist", "loadfile").assert_outcomes(passed=2)
    assert sorted((pytester.path / "driven").read_text().split()) == ["False", "True"]
