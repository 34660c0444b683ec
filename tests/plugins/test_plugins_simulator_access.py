"""Plugins that use the simulator are found: in their source, and in a run."""

import importlib
import os
from pathlib import Path

import pytest
from cli_calls import put_file
from plugins_samples import put

from navfw.missions import MissionResult, plugins_of, prepare
from navfw.plugins import SimulatorWatch, default_registry, source_findings
from navfw.robot import RobotModel

BEHAVIOR = '''\
"""A behaviour."""


def traceback_of():
    try:
        raise ValueError
    except ValueError as error:
        return getattr(error.__traceback__, "tb_" + "frame")


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
OBSCURE = '"".join(["py", "bullet"])'
USERS = {
    "imports_at_the_top": ("import pybullet", "pass"),
    "imports_inside": ("", "import pybullet as engine"),
    "imports_a_part": ("from navfw import sim", "pass"),
    "imports_navfw_sim": ("", "from navfw.sim.simulation import Simulation"),
    "imports_the_session": ("import navfw.missions.session as session", "pass"),
    "imports_by_importlib": ("import importlib", 'importlib.import_module("pybullet")'),
    "reads_sys_modules": ("import sys", 'sys.modules["pybullet"]'),
    "names_it_in_pieces": ("import importlib", f"importlib.import_module({OBSCURE})"),
    "imports_in_pieces": ("", f"__import__({OBSCURE})"),
    "keeps_it": ("import sys", f"self.engine = [sys.modules[{OBSCURE}]]"),
    "by_a_helper": ("from ._engine import pose_of", "pose_of(1)"),
    "by_a_helper_module": ("from . import _engine", "pass"),
    "by_frames": ("import sys", "sys._getframe(1)"),
    "by_inspection": ("import inspect", "inspect.stack()"),
    "by_all_objects": ("import gc", "gc.get_objects()[:1]"),
    "by_subclasses": ("", "object.__subclasses__()"),
    "by_globals": ("", "context.commands.zeros.__globals__"),
    "by_code": ("", 'exec("import " + "pybullet")'),
    "by_frames_in_pieces": ("import sys", 'getattr(sys, "_get" + "frame")(1)'),
    "by_objects_in_pieces": ("import gc", 'getattr(gc, "get_" + "referrers")(context)[:1]'),
    "by_a_traceback": ("", "traceback_of()"),
    "by_ctypes": ("import ctypes", "ctypes.string_at(id(context), 8)"),
}
HELPER = (
    '"""A helper."""\n\nimport pybullet\n\n\ndef pose_of(body):\n    return pybullet.__name__\n'
)
PLAIN = {
    "plain": ("import sys\nimport importlib", 'importlib.import_module("json")'),
    "by_a_detour": ("import ctypes\nimport gc\nimport sys", "len(sys.modules)"),
}


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
    assert result.run.faults == ()
    assert set(result.oracle_plugins) == set(USERS)
    summary = result.summary()
    assert summary["oracle"] is True
    assert summary["oracle_plugins"] == sorted(USERS)


@pytest.mark.parametrize(
    ("line", "what", "uses"),
    [
        ("import numpy, pybullet_data", "imports pybullet_data", True),
        ("import navfw.sim.simulation", "imports navfw.sim.simulation", True),
        ("from navfw import missions", "imports navfw.missions", True),
        ("from pybullet_utils import bullet_client", "imports pybullet_utils", True),
        ("def f():\n    import pybullet", "imports pybullet", True),
        ("x = modules['navfw.sim']", "names the module navfw.sim", True),
        ("import sys\nx = sys.modules", "reads sys.modules", False),
        ("from sys import modules", "imports sys.modules", False),
        ("from gc import get_objects as o", "imports gc.get_objects", True),
        ("import ctypes", "imports ctypes", False),
        ("import inspect\ninspect.currentframe()", "reads inspect.currentframe", True),
        ("x = import_module(name)", "calls import_module", True),
        ("x = sys_modules.modules[name]", "reads a module of a computed name", True),
        ("x = eval('1')", "calls eval", True),
        ("x = e.__traceback__.tb_frame", "reads tb_frame", True),
    ],
)
def test_findings_in_a_source(tmp_path: Path, line: str, what: str, uses: bool) -> None:
    (finding,) = source_findings(put(tmp_path, "one", line))
    assert (finding.what, finding.uses) == (what, uses)
    assert finding.line == line.count("\n") + 1


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
    assert source_findings(put(tmp_path, "one", text)) == ()
    assert source_findings(tmp_path / "missing.py") == ()


def test_a_changed_source_is_read_again(tmp_path: Path) -> None:
    assert source_findings(put(tmp_path, "one", "import pybullet\n"))
    file = put(tmp_path, "one", "import numpy\n# other\n")
    os.utime(file, ns=(1, 1))
    assert not source_findings(file)


def test_a_listing_has_notes(tmp_path: Path) -> None:
    write(tmp_path, {"by_a_detour": PLAIN["by_a_detour"]})
    registry = default_registry([tmp_path])
    (row,) = (row for row in registry.listing("behavior") if row["name"] == "by_a_detour")
    notes = [note.rpartition(": ")[2] for note in row["notes"]]
    assert notes == ["imports ctypes", "reads sys.modules"]
    assert row["notes"][0].startswith(f"{tmp_path / 'by_a_detour.py'}:11: ")


def test_imports_by_navfw_itself_count_for_nobody() -> None:
    registry = default_registry()
    behavior = registry.get("behavior", "cruise")(RobotModel())
    with SimulatorWatch({"cruise": behavior}) as watch:
        importlib.import_module("navfw.sim.shapes")
        import navfw.sim.shapes  # noqa: F401
    assert watch.found() == ()
