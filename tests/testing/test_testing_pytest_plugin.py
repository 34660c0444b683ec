"""The pytest plugin: markers, mission files, the cache, reports; tests that fail as they must."""

import json
import os
import shutil
import textwrap
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from cli_calls import put_files
from processes import printed

from navfw.config.lookup import shipped_folder
from navfw.missions import MissionResult, prepare
from navfw.missions.run_report import draw_trajectory
from navfw.testing import mission_cache, mission_run
from navfw.testing.mission_cache import read_run, store_run
from navfw.testing.mission_case import MissionCase
from navfw.testing.mission_run import MissionRun

pytest_plugins = "pytester"

IMPORT = "import pytest\n"
SHORT = 'set=["mission.timeout=1.5"]'  # every run ends after 1.5 s, as a timeout
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
    draw_trajectory(result, tmp_path_factory.mktemp("warm") / "trajectory.png")


@pytest.fixture
def drives(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The missions that are driven, in order."""
    driven: list[str] = []

    def drive(case: MissionCase) -> MissionResult:
        driven.append(case.label)
        return original(case)

    original = mission_run.drive
    for module in (mission_run, mission_cache):
        monkeypatch.setattr(module, "drive", drive)
    return driven


def outcomes(pytester: pytest.Pytester, text: str, *options: str) -> pytest.RunResult:
    pytester.makepyfile(IMPORT + textwrap.dedent(text))
    return pytester.runpytest_inprocess("-p", "no:cacheprovider", *options)


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
    assert Path(section(first, "picture")).read_bytes()[:4] == b"\x89PNG"
    assert Path(section(first, "recording")).stat().st_size > 1000
    pytester.runpytest_inprocess("--mission-fresh")
    assert len(drives) == 3
    mission = place / "missions" / "straight.yaml"
    (place / "missions" / "other.yaml").write_text("changed: too")
    pytester.makepyfile(text + "    assert mission.cached")
    pytester.runpytest_inprocess().assert_outcomes(passed=1)
    assert len(drives) == 3, "no file of this mission has changed"
    mission.write_text(mission.read_text() + "# changed\n")
    pytester.runpytest_inprocess()
    assert len(drives) == 4


def test_a_mission_file_is_a_test(pytester: pytest.Pytester) -> None:
    mission = "start: [1, 2, 0]\ngoals: [{x: 1.9, y: 2}]\ntimeout: 20\nsuccess: {within: 1.5}\n"
    texts = {
        "near": mission + "tolerance: 1.0\n",
        "far": mission.replace("20", "1"),
        "wrong": mission + "stack: defalt\n",
    }
    put_files(pytester.path / "worlds/empty/missions", {f"{k}.yaml": texts[k] for k in texts})
    (pytester.path / "navfw.toml").touch()
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
    text = MARKED + "    assert mission.outcome == 'reached'"
    done = outcomes(pytester, text, "--junit-xml", "report.xml")
    tree = ElementTree.parse(pytester.path / "report.xml")  # noqa: S314 - written by pytest
    found = {p.get("name"): str(p.get("value")) for p in tree.iter("property")}
    assert found["outcome"] == "timeout"
    assert "1.5 s" in found["reason"]
    assert (found["stack"], found["seed"], len(found["command_hash"])) == ("default", "0", 64)
    assert found["picture"] == section(done, "picture")
    assert found["recording"] == section(done, "recording")
    picture = Path(found["picture"])
    assert picture.read_bytes()[:4] == b"\x89PNG"
    result = json.loads((picture.parent / "result.json").read_text())
    assert (result["outcome"], result["seed"]) == ("timeout", 0)
    of_run = ["*- mission -*", "empty/straight, seed 0", "outcome: timeout after 1.5 s*"]
    decisions = ["the last decisions:", "*leads", "the last command:", "  at *led by*"]
    done.stdout.fnmatch_lines([*of_run, "reason: *1.5*", *decisions])


def test_a_fault_of_a_plugin_fails_the_test(pytester: pytest.Pytester) -> None:
    put_files(pytester.path, {"navfw.toml": "", "behaviors/hover.py": FAULTY})
    marker = '@pytest.mark.mission("empty", "straight", set=["mission.timeout=1.5"'
    tests = (
        f"{marker}, 'behaviors.hover='])\ndef test_a(mission):\n    assert mission.faults\n"
        f"{marker}, 'behaviors.hover='], allow_faults=True)\n"
        "def test_b(mission):\n    assert 'in propose: return 1 / 0' in mission.faults[0]"
    )
    done = outcomes(pytester, tests)
    done.assert_outcomes(passed=1, failed=1)
    fault = "behavior hover: ZeroDivisionError: division by zero (behaviors/hover.py:11, in propose"
    done.stdout.fnmatch_lines(
        ["a plugin faulted; *allow_faults=True*", f"  {fault}: return 1 / 0) (*first at*"]
    )


def test_there_is_a_test_for_each_mission_and_seed(pytester: pytest.Pytester) -> None:
    marker = """
    @pytest.mark.mission(world="empty", mission=["straight", "turn-back"],
                         seeds=[1, pytest.param(2, marks=pytest.mark.skip)])
    def test_it(mission):
        pass
    """
    words = (marker, "--collect-only", "-q", "--mission-seeds")
    done = outcomes(pytester, *words, "0:2")
    assert [line.split("::")[1] for line in done.outlines if "::" in line] == [
        f"test_it[{name}-seed{seed}]" for name in ("straight", "turn-back") for seed in (1, 2, 0)
    ]
    done = outcomes(pytester, *words, "3")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(["*--mission-seeds: expected A:B*"])


def test_the_stack_of_the_mission_counts_unless_the_test_names_one(
    pytester: pytest.Pytester,
) -> None:
    marker = '@pytest.mark.mission("office", "patrol", set="mission.timeout=1"'
    text = f"{marker})\ndef test_a(mission):\n    assert mission.stack == 'default'\n"
    text += f"{marker}, stack='default')\ndef test_b(mission):\n    assert mission.stack == ''\n"
    done = outcomes(pytester, text)
    done.assert_outcomes(failed=2)
    done.stdout.fnmatch_lines(["stack:   landmarks (named by the mission)"])
    done.stdout.fnmatch_lines(["stack:   default (named by the test)"])


def test_a_stored_run_is_the_same(tmp_path: Path) -> None:
    result = prepare("empty", "straight", overrides={"mission.timeout": 1.5}).run()
    case, file = MissionCase("empty", "straight"), tmp_path / "run.json"
    store_run(MissionRun.of(result, case, tmp_path), file)
    read = read_run(file, case, tmp_path)
    assert read is not None
    assert read.log.command_hash == result.log.command_hash
    assert read.summary() == result.summary()
    assert (read.verdict, read.log.waypoints) == (result.verdict, result.log.waypoints)
    assert np.array_equal(read.log.leader, result.log.leader)
    assert read.log.sight.dtype == result.log.sight.dtype
    file.write_bytes(file.read_bytes()[:-100])
    assert read_run(file, case, tmp_path) is None
    assert read_run(tmp_path / "none", case, tmp_path) is None


@pytest.mark.slow
def test_workers_of_xdist_share_the_runs(pytester: pytest.Pytester) -> None:
    text = MARKED + "    with open('driven', 'a') as file: print(mission.cached, file=file)"
    pytester.makepyfile(test_a=text, test_b=text)
    pytester.runpytest_subprocess("-n", "2", "--dist", "loadfile").assert_outcomes(passed=2)
    assert sorted((pytester.path / "driven").read_text().split()) == ["False", "True"]


def test_the_fixture_gives_outcome_metrics_path_and_commands(pytester: pytest.Pytester) -> None:
    text = f"""
    @pytest.mark.mission(world="empty", mission="straight", seeds=[3], {SHORT})
    class TestRun:
        def test_numbers(self, mission):
            assert mission.outcome == "timeout"
            assert "1.5 s" in mission.reason
            assert mission.seed == 3
            assert mission.path.shape == mission.commands.shape == (mission.log.ticks, 3)
            assert mission.commands[-1, 0] == pytest.approx(1.5, abs=0.05)
            assert mission.collisions == 0

        def test_the_same_run_is_driven_once(self, mission, request):
            from navfw.testing.pytest_plugin import CACHE
            assert len(request.config.stash[CACHE].runs) == 1
    """
    outcomes(pytester, text).assert_outcomes(passed=2)


def test_a_passing_test_leaves_no_folder_by_default(pytester: pytest.Pytester) -> None:
    text = f"""
    @pytest.mark.mission(world="empty", mission="straight", {SHORT})
    def test_it(mission, tmp_path_factory):
        assert not list(tmp_path_factory.getbasetemp().rglob("result.json"))
    """
    outcomes(pytester, text).assert_outcomes(passed=1)
    text = text.replace("assert not", "pass #")
    outcomes(pytester, text, "--mission-runs", "kept").assert_outcomes(passed=1)
    (folder,) = (pytester.path / "kept").iterdir()
    assert folder.name.startswith("empty-straight-0-")
    assert (folder / "trajectory.png").exists()


WRONG = {
    'world="empty", mission="straigth"': "did you mean 'straight'?",
    'world="emty", mission="straight"': "did you mean 'empty'?",
    'world="empty", mission="straight", stack="defalt"': "did you mean 'default'?",
    'world="empty", mission="straight", set="ofis.layers=1"': "did you mean 'offis'?",
    'world="empty", mission="straight", set={"avoid.latancy": 1}': "did you mean 'latency'?",
    'world="empty", mission="straight", set="sensors.preset=best"': "perfect",
    'world="empty", mission="straight", set={"mission.timeout": object()}': "plain data",
    'world="empty"': "missing argument: mission",
    'mission="straight"': "missing argument: world",
    'world="empty", mission="straight", seed=1': "did you mean 'seeds'?",
    'world="empty", mission="straight", seeds=[]': "at least one",
    'world="empty", mission="straight", seeds=["a"]': "whole number",
    'world="empty", mission="straight", seeds=[True]': "whole number",
}


def test_a_wrong_marker_is_reported_when_collecting(pytester: pytest.Pytester) -> None:
    for number, marker in enumerate(WRONG):
        text = f"{IMPORT}@pytest.mark.mission({marker})\ndef test_it(mission):\n    pass\n"
        pytester.path.joinpath(f"test_{number:02d}.py").write_text(text)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(errors=len(WRONG))
    sections = done.stdout.str().split("ERROR collecting test_")[1:]
    for section, message in zip(sections, WRONG.values(), strict=True):
        assert message in section
        assert "Traceback" not in section


def test_what_is_wrong_is_told_once(pytester: pytest.Pytester) -> None:
    marker = '@pytest.mark.mission(world="emty", mission="straight", seeds=range(9))'
    for name in ("test_a.py", "test_b.py"):
        tests = "".join(f"{marker}\ndef test_{n}(mission):\n    pass\n" for n in range(3))
        pytester.path.joinpath(name).write_text(IMPORT + tests)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider", "-rN")
    done.assert_outcomes(errors=1)
    assert done.stdout.str().count("did you mean 'empty'?") == 1


def test_the_fixture_without_its_marker_reports_it(pytester: pytest.Pytester) -> None:
    done = outcomes(pytester, "", "--markers")
    assert "@pytest.mark.mission(world, mission" in done.stdout.str()
    done = outcomes(pytester, "def test_it(mission):\n    pass\n")
    done.assert_outcomes(errors=1)
    assert "@pytest.mark.mission" in done.stdout.str()


def test_loading_the_plugin_imports_nothing_heavy() -> None:
    code = """
import sys
import navfw.testing.pytest_plugin
heavy = ("numpy", "pybullet", "cv2", "numba", "matplotlib", "pydantic", "networkx", "navfw.sim")
print([name for name in heavy if name in sys.modules])
"""
    assert printed(code) == "[]"


REGISTRY = """
from navfw.plugins import default_registry
def test_it(monkeypatch):
    monkeypatch.chdir({folder!r})
    assert "hover" in default_registry().names("behavior")
"""


def test_tests_execute_the_plugins_of_their_own_project_alone(
    pytester: pytest.Pytester, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NAVFW_TRUST")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    other = tmp_path / "other"
    for project in (pytester.path, other):
        put_files(project, {"navfw.toml": "", "behaviors/hover.py": ""})
    for folder, passed in ((pytester.path, 1), (other, 0)):
        tests = pytester.mkdir(f"tests_{passed}")
        (tests / "test_it.py").write_text(REGISTRY.format(folder=str(folder)))
        done = pytester.runpytest_inprocess("-p", "no:cacheprovider", tests)
        done.assert_outcomes(passed=passed, failed=1 - passed)
    done.stdout.fnmatch_lines(["*UntrustedCodeError: *not trusted, so its code is not executed*"])
    assert "NAVFW_TRUST" not in os.environ
