"""Plugins whose source imports the simulator mark the result of a run as that of an oracle."""

from pathlib import Path

import pytest
from cli_calls import put_file
from plugins_samples import put

from navfw.missions import MissionResult, prepare
from navfw.missions.oracle import plugins_of
from navfw.plugins import default_registry
from navfw.plugins.simulator_access import simulator_imports

BEHAVIOR = '''\
"""A behaviour."""

{top}

from navfw import Behavior, Context, Proposal


class {title}(Behavior):
    """Proposes nothing, and has a look."""

    name = "{name}"

    def propose(self, context: Context) -> Proposal:
        nothing = context.commands.zeros()
        {inside}
        return Proposal(0.0, nothing, nothing, "a look")
'''
USERS = {
    "imports_at_the_top": ("import pybullet", "pass"),
    "imports_inside": ("", "import pybullet as engine"),
    "imports_a_part": ("from navfw import sim", "pass"),
    "imports_navfw_sim": ("", "from navfw.sim.simulation import Simulation"),
    "imports_the_session": ("import navfw.missions.session as session", "pass"),
    "imports_by_importlib": ("import importlib", 'importlib.import_module("pybullet")'),
    "by_a_helper": ("from ._engine import pose_of", "pose_of(1)"),
    "by_a_helper_module": ("from . import _engine", "pass"),
}
HELPER = (
    '"""A helper."""\n\nimport pybullet\n\n\ndef pose_of(body):\n    return pybullet.__name__\n'
)
PLAIN = {"plain": ("import sys\nimport importlib", 'importlib.import_module("json")')}


def write(folder: Path, behaviors: dict[str, tuple[str, str]]) -> Path:
    """A folder of behaviours, with a stack file that has them all."""
    put(folder, "_engine", HELPER)
    for name, (top, inside) in behaviors.items():
        title = name.title().replace("_", "")
        put(folder, name, BEHAVIOR.format(name=name, title=title, top=top, inside=inside))
    named = "".join(f"  {name}:\n" for name in ("go_to_xy", *behaviors))
    return put_file(folder, "spying.yaml", f"base: default\nbehaviors:\n{named}")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> MissionResult:
    """A run with all of the behaviours above."""
    folder = tmp_path_factory.mktemp("behaviors")
    stack = write(folder, USERS | PLAIN)
    registry = default_registry([folder])
    overrides = ["mission.timeout=1.5"]
    session = prepare("empty", "straight", stack=stack, overrides=overrides, registry=registry)
    shipped = {"go_to_xy", "block_matching", "offis", "papfis", "fuzzy", "unicycle"}
    assert set(plugins_of(session.stack)) >= shipped | set(USERS)
    return session.run()


def test_a_run_names_the_plugins_that_use_the_simulator(result: MissionResult) -> None:
    assert result.faults == ()
    assert set(result.oracle_plugins) == set(USERS)
    summary = result.summary()
    assert summary["oracle"] is True
    assert summary["oracle_plugins"] == tuple(sorted(USERS))


@pytest.mark.parametrize(
    ("line", "module"),
    [
        ("import numpy, pybullet_data", "pybullet_data"),
        ("import navfw.sim.simulation", "navfw.sim.simulation"),
        ("from navfw import missions", "navfw.missions"),
        ("from pybullet_utils import bullet_client", "pybullet_utils"),
        ("def f():\n    import pybullet", "pybullet"),
        ("from importlib import import_module\nimport_module('navfw.sim')", "navfw.sim"),
    ],
)
def test_imports_in_a_source(tmp_path: Path, line: str, module: str) -> None:
    assert simulator_imports(put(tmp_path, "one", line)) == ((line.count("\n") + 1, module),)


@pytest.mark.parametrize(
    "text",
    [
        "import numpy\nfrom navfw.signals import Pose\n",
        '"""Not pybullet: navfw.sim is for others."""\nimport simulation\n',
        "from navfw.simple import x\n",
        "from . import sim\n",
        "def broken(:\n",
        "\0",
    ],
)
def test_other_sources_have_no_findings(tmp_path: Path, text: str) -> None:
    assert simulator_imports(put(tmp_path, "one", text)) == ()
    assert simulator_imports(tmp_path / "missing.py") == ()


def test_a_listing_has_notes(tmp_path: Path) -> None:
    write(tmp_path, {"looks": ("import numpy", "import pybullet")})
    registry = default_registry([tmp_path])
    (row,) = (row for row in registry.listing("behavior") if row["name"] == "looks")
    assert row["notes"] == [f"{tmp_path / 'looks.py'}:15: imports pybullet"]
