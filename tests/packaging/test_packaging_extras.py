"""Without its extras navfw imports, and each command, option and name says which one it needs."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from processes import Done, python

from navfw.config import extra_imports, require_extra
from navfw.errors import MissingExtraError

ROOT = Path(__file__).parents[2]

OPTIONAL = """
    pybullet pybullet_data matplotlib bokeh jinja2 foxglove mcap mcap_protobuf trimesh collada
    gymnasium optuna distributed av pandas navground skfuzzy
"""
"""The modules of all extras."""

COMMANDS = {
    "run empty straight": "sim",
    "suite rooms --seeds 0:1": "sim",
    "reproduce": "sim",
    "bench loop": "sim",
    "tune rooms --stack default --trials 1": "tune",
    "replay RUN": "record",
    "explain RUN --at 1": "record",
    "report RUN": "record",
    "map show empty": "report",
    "replay RUN --video out.mp4": "record",
}
"""Commands, and the first extra that each of them lacks."""

NAMES = {
    "navfw.run": "sim",
    "navfw.open_simulation": "sim",
    "navfw.open_run": "record",
    "navfw.gym": "gym",
}
"""Names of Python, likewise."""

CORE = ("Stack", "SensorReading", "Frame", "RobotModel", "load_map", "RuledBehavior", "Planner")


def without_extras(code: str, folder: Path) -> Done:
    """What ``code`` prints in a fresh process in which no module of an extra can be imported."""
    blocked = f"import sys; sys.modules.update(dict.fromkeys({OPTIONAL.split()!r}))\n"
    return python(blocked + code, cwd=folder)


def test_every_extra_is_among_all() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (everything,) = project["optional-dependencies"].pop("all")[:1]
    named = re.fullmatch(r"navfw\[(.+)\]", everything)
    assert named is not None
    assert sorted(named[1].split(",")) == sorted(project["optional-dependencies"])


def test_the_message_names_module_extra_and_remedy() -> None:
    with pytest.raises(MissingExtraError) as caught, extra_imports("report", key="--plot"):
        import no_such_module  # type: ignore[import-not-found]  # noqa: F401
    assert caught.value.extra == "report"
    assert str(caught.value) == (
        "--plot: needs no_such_module, which is not installed: pip install 'navfw[report]', or in"
        " a clone uv sync --extra report"
    )
    with pytest.raises(MissingExtraError, match=r"navfw tune: needs no_such_module, .*\[tune\]"):
        require_extra("tune", "no_such_module", key="navfw tune")
    require_extra("sim", "math")


def test_an_error_of_another_kind_is_not_taken_for_a_missing_extra() -> None:
    with pytest.raises(ZeroDivisionError), extra_imports("sim"):
        _ = 1 // 0


def test_the_robots_half_needs_no_extra(tmp_path: Path) -> None:
    code = f"import navfw; print([getattr(navfw, name).__name__ for name in {CORE!r}])"
    done = without_extras(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(list(CORE))


@pytest.mark.thorough
@pytest.mark.parametrize(("words", "extra"), COMMANDS.items())
def test_a_command_says_which_extra_it_needs(words: str, extra: str, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "result.json").write_text("{}", encoding="utf-8")
    argv = [str(run) if word == "RUN" else word for word in words.split()]
    code = f"sys.argv = ['navfw', *{argv!r}]\nfrom navfw.cli import main; main()"
    done = without_extras(code, tmp_path)
    assert done.returncode == 2, done.stdout + done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("navfw: ")
    assert f"pip install 'navfw[{extra}]'" in line
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize(("name", "extra"), NAMES.items())
def test_a_name_says_which_extra_it_needs(name: str, extra: str, tmp_path: Path) -> None:
    module, _, attribute = name.partition(".")
    code = f"from {module} import {attribute}" if attribute != "gym" else "import navfw.gym"
    done = without_extras(code, tmp_path)
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("navfw.errors.MissingExtraError: ")
    assert f"pip install 'navfw[{extra}]'" in last
