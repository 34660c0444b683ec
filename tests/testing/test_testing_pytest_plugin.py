"""The pytest plugin: tests that pass, fail, and have a wrong marker."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest_plugins = "pytester"

IMPORT = "import pytest\n"
SHORT = 'set=["mission.timeout=1.5"]'  # every run ends after 1.5 s, as a timeout


@pytest.fixture(scope="module", autouse=True)
def _everything_imported(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Pytester removes modules imported inside it, and numpy cannot be imported twice."""
    from navfw.missions import draw, prepare

    result = prepare("empty", "straight", overrides=["mission.timeout=1.5"]).run()
    draw(result, tmp_path_factory.mktemp("warm") / "trajectory.png")


def outcomes(pytester: pytest.Pytester, text: str, *options: str) -> pytest.RunResult:
    pytester.makepyfile(IMPORT + text)
    return pytester.runpytest_inprocess("-p", "no:cacheprovider", *options)


def test_one_test_for_each_mission_and_seed(pytester: pytest.Pytester) -> None:
    marker = """
    @pytest.mark.mission(world="empty", mission=["straight", "turn-back"],
                         seeds=[1, pytest.param(2, marks=pytest.mark.skip)])
    def test_it(mission):
        pass
    """
    done = outcomes(pytester, _dedent(marker), "--collect-only", "-q")
    lines = [line for line in done.outlines if "::" in line]
    assert [line.split("::")[1] for line in lines] == [
        "test_it[straight-seed1]",
        "test_it[straight-seed2]",
        "test_it[turn-back-seed1]",
        "test_it[turn-back-seed2]",
    ]


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
            assert mission.metrics.collisions == 0

        def test_the_same_run_is_driven_once(self, mission, request):
            from navfw.testing.pytest_plugin import RUNS
            assert len(request.config.stash[RUNS]) == 1
    """
    outcomes(pytester, _dedent(text)).assert_outcomes(passed=2)


def test_a_failure_shows_outcome_reason_and_picture(pytester: pytest.Pytester) -> None:
    text = f"""
    @pytest.mark.mission(world="empty", mission="straight", seeds=[4], {SHORT})
    def test_it(mission):
        assert mission.outcome == "reached"
    """
    done = outcomes(pytester, _dedent(text))
    done.assert_outcomes(failed=1)
    done.stdout.fnmatch_lines(
        [
            "*- mission -*",
            "empty/straight, seed 4",
            "outcome: timeout after 1.5 s*",
            "reason: *1.5*",
        ]
    )
    (line,) = [line for line in done.outlines if line.startswith("picture: ")]
    picture = Path(line.removeprefix("picture: "))
    assert picture.read_bytes()[:4] == b"\x89PNG"
    result = json.loads((picture.parent / "result.json").read_text())
    assert (result["outcome"], result["seed"]) == ("timeout", 4)


def test_a_passing_test_leaves_no_folder_by_default(pytester: pytest.Pytester) -> None:
    text = f"""
    @pytest.mark.mission(world="empty", mission="straight", {SHORT})
    def test_it(mission, tmp_path_factory):
        assert not list(tmp_path_factory.getbasetemp().rglob("result.json"))
    """
    outcomes(pytester, _dedent(text)).assert_outcomes(passed=1)
    text = text.replace("assert not", "pass #")
    outcomes(pytester, _dedent(text), "--mission-runs", "kept").assert_outcomes(passed=1)
    (folder,) = (pytester.path / "kept").iterdir()
    assert folder.name.startswith("empty-straight-0-")
    assert (folder / "trajectory.png").exists()


CANNOT_BE_DRIVEN = {
    'world="empty", mission="straigth"': "did you mean 'straight'?",
    'world="emty", mission="straight"': "did you mean 'empty'?",
    'world="empty", mission="straight", stack="defalt"': "did you mean 'default'?",
    'world="empty", mission="straight", set="ofis.layers=1"': "did you mean 'offis'?",
    'world="empty", mission="straight", set={"avoid.latancy": 1}': "did you mean 'latency'?",
    'world="empty", mission="straight", set="sensors.preset=best"': "perfect",
    'world="empty", mission="straight", set={"mission.timeout": object()}': "plain data",
}


def test_a_mission_that_cannot_be_driven_is_told_when_collecting(
    pytester: pytest.Pytester,
) -> None:
    for number, marker in enumerate(CANNOT_BE_DRIVEN):
        text = f"{IMPORT}@pytest.mark.mission({marker})\ndef test_it(mission):\n    pass\n"
        pytester.path.joinpath(f"test_{number}.py").write_text(text)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(errors=len(CANNOT_BE_DRIVEN))
    sections = done.stdout.str().split("ERROR collecting test_")[1:]
    for section, message in zip(sections, CANNOT_BE_DRIVEN.values(), strict=True):
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


MISWRITTEN = {
    'world="empty"': "missing argument: mission",
    'mission="straight"': "missing argument: world",
    'world="empty", mission="straight", seed=1': "did you mean 'seeds'?",
    'world="empty", mission="straight", seeds=[]': "at least one",
    'world="empty", mission="straight", seeds=["a"]': "whole number",
    'world="empty", mission="straight", seeds=[True]': "whole number",
}


def test_a_miswritten_marker_is_reported_when_collecting(pytester: pytest.Pytester) -> None:
    for number, marker in enumerate(MISWRITTEN):
        text = f"{IMPORT}@pytest.mark.mission({marker})\ndef test_it(mission):\n    pass\n"
        pytester.path.joinpath(f"test_{number}.py").write_text(text)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(errors=len(MISWRITTEN))
    sections = done.stdout.str().split("ERROR collecting test_")[1:]
    for section, message in zip(sections, MISWRITTEN.values(), strict=True):
        assert message in section


def test_the_fixture_without_a_marker_reports_it(pytester: pytest.Pytester) -> None:
    done = outcomes(pytester, "def test_it(mission):\n    pass\n")
    done.assert_outcomes(errors=1)
    assert "@pytest.mark.mission" in done.stdout.str()


def test_the_marker_is_registered(pytester: pytest.Pytester) -> None:
    done = outcomes(pytester, "", "--markers")
    assert "@pytest.mark.mission(world, mission" in done.stdout.str()


def test_loading_the_plugin_imports_nothing_heavy() -> None:
    code = """
import sys
import navfw.testing.pytest_plugin
heavy = ("numpy", "pybullet", "cv2", "numba", "matplotlib", "pydantic", "networkx", "navfw.sim")
print([name for name in heavy if name in sys.modules])
"""
    done = subprocess.run(  # noqa: S603 - this Python, fixed arguments
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.strip() == "[]"


def _dedent(text: str) -> str:
    import textwrap

    return textwrap.dedent(text)


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
        (project / "behaviors").mkdir(parents=True)
        (project / "navfw.toml").touch()
        (project / "behaviors" / "hover.py").touch()
    for folder, passed in ((pytester.path, 1), (other, 0)):
        tests = pytester.mkdir(f"tests_{passed}")
        (tests / "test_it.py").write_text(REGISTRY.format(folder=str(folder)))
        done = pytester.runpytest_inprocess("-p", "no:cacheprovider", tests)
        done.assert_outcomes(passed=passed, failed=1 - passed)
    done.stdout.fnmatch_lines(["*UntrustedCodeError: *not trusted, so its code is not executed*"])
    assert "NAVFW_TRUST" not in os.environ


def test_a_damaged_project_does_not_stop_other_tests(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("pyproject.toml").write_text("[tool.navfw]\nx = \n")
    pytester.makepyfile("def test_it():\n    pass\n")
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider", "-c", "/dev/null", "--rootdir=.")
    done.assert_outcomes(passed=1)
