from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, ClassVar

import pytest

from navfw.errors import PluginError, UnknownNameError
from navfw.features.none import NoFeatures
from navfw.kinds import KINDS, Behavior
from navfw.plugins import BUILT_IN, GROUPS, Registry, default_registry, importing, plugin
from navfw.plugins import registry as registry_module
from navfw.robot import RobotModel

GOOD = '''
from navfw.kinds import Behavior

class {cls}(Behavior):
    """{cls} does a thing.

    And more.
    """
    name = "{name}"
    def propose(self, context): pass
'''


class Mine(Behavior):
    """Mine."""

    name: ClassVar[str] = "mine"

    def propose(self, context: Any) -> Any:
        del context


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "behaviors"
    path.mkdir()
    return path


@pytest.fixture(autouse=True)
def _sys_path_stays() -> Iterator[None]:
    before = list(sys.path)
    yield
    assert sys.path == before


def put(folder: Path, name: str, text: str | None = None, cls: str = "Thing") -> Path:
    file = folder / f"{name}.py"
    file.write_text(GOOD.format(cls=cls, name=name) if text is None else text)
    return file


def discovered(folder: Path) -> Registry:
    registry = Registry()
    registry.discover_folder(folder)
    return registry


def statuses(registry: Registry, kind: str = "behavior") -> dict[str, str]:
    return {row["name"]: row["status"] for row in registry.listing(kind)}


# --- in code --------------------------------------------------------------------------------------


def test_register_and_get() -> None:
    registry = Registry()
    registry.register(Mine)
    registry.register(NoFeatures, source="a test")
    assert registry.get("behavior", "mine") is Mine
    assert registry.get("features", "none") is NoFeatures
    assert registry.names("behavior") == ["mine"]
    (row,) = registry.listing("features")
    assert row == {
        "name": "none",
        "kind": "features",
        "status": "ok",
        "source": "a test",
        "summary": "Recognizes nothing: no frame has landmarks in it.",
        "parameters": [],
        "error": None,
    }


def test_registering_the_same_class_again_is_no_matter() -> None:
    registry = Registry()
    registry.register(Mine)
    registry.register(Mine)
    assert len(registry.listing()) == 1


def test_a_bad_class_is_refused_at_once() -> None:
    registry = Registry()
    with pytest.raises(PluginError, match="not derived from a kind of plugin"):
        registry.register(int)  # type: ignore[arg-type]
    assert registry.listing() == []


def test_unknown_names_get_the_nearest() -> None:
    registry = Registry()
    registry.register(Mine)
    with pytest.raises(
        UnknownNameError, match="unknown behavior plugin 'mime': did you mean 'mine'"
    ):
        registry.get("behavior", "mime")
    with pytest.raises(
        UnknownNameError, match="unknown kind of plugin 'behaviour': did you mean 'b"
    ):
        registry.get("behaviour", "mine")
    with pytest.raises(UnknownNameError, match="unknown kind"):
        registry.listing("behaviour")


def test_the_decorator_reaches_default_registries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importing, "_decorated", {})
    assert plugin(Mine) is Mine
    assert default_registry().get("behavior", "mine") is Mine


def test_the_decorator_refuses_a_bad_class_at_once() -> None:
    with pytest.raises(PluginError, match="no docstring"):

        @plugin
        class Bad(Behavior):
            name = "bad"

            def propose(self, context: Any) -> Any:
                del context


# --- folders --------------------------------------------------------------------------------------


def test_a_folder_is_discovered(folder: Path) -> None:
    put(folder, "one")
    put(folder, "two", GOOD.format(cls="A", name="a") + GOOD.format(cls="B", name="b"))
    put(folder, "_helper", "raise RuntimeError")
    (folder / "notes.txt").write_text("not python")
    registry = discovered(folder)
    assert statuses(registry) == {"one": "ok", "a": "ok", "b": "ok"}
    cls = registry.get("behavior", "one")
    assert isinstance(cls(RobotModel()), Behavior)
    assert registry.listing()[2]["summary"] == "Thing does a thing."
    assert registry.listing()[2]["source"].endswith("behaviors/one.py")


BROKEN = {
    "syntax": ("def f(:\n", "syntax.py:1: cannot be imported: SyntaxError"),
    "raises": (
        "\n\n1 / 0\n",
        "raises.py:3: cannot be imported: ZeroDivisionError: division by zero",
    ),
    "leaves": ("import sys\nsys.exit(3)\n", "leaves.py:2: cannot be imported: SystemExit: 3"),
    "interrupts": (
        "class Odd(BaseException): pass\nraise Odd\n",
        "interrupts.py:2: cannot be imported: Odd",
    ),
    "deep": ("def f():\n    return {}['x']\nf()\n", "deep.py:2: cannot be imported: KeyError: 'x'"),
    "needs": (
        "import nosuchpackage\n",
        "needs.py:1: cannot be imported: ModuleNotFoundError: No module named 'nosuchpackage'; "
        "install it",
    ),
    "beside": ("import helper\n", "from .helper import ..."),
    "relative": ("from . import nothing\n", "relative.py:1: cannot be imported: ImportError"),
    "recursion": ("def f(): f()\nf()\n", "cannot be imported: RecursionError"),
    "empty": ("", "empty.py: no plugin in this file; derive a class from navfw.kinds.Behavior"),
    "wrong_base": ("class Turn: pass\n", "no plugin in this file (it has Turn); derive a class"),
    "no_name": (
        GOOD.format(cls="Turn", name="x").replace('name = "x"', ""),
        "class Turn: no name; write",
    ),
    "incomplete": (
        "from navfw.kinds import Behavior\nclass T(Behavior):\n    'T.'\n    name = 'incomplete'\n",
        "incomplete.py:2: class T: missing propose(self, context)",
    ),
    "decorated": (
        "from navfw.plugins import plugin\n\n@plugin\nclass Turn:\n    name = 'decorated'\n",
        "class Turn: not derived from a kind of plugin",
    ),
    "not_utf8": (b"a = '\xff'\n", "cannot be imported: SyntaxError"),
    "nulls": (b"a = 1\0\n", "cannot be imported: "),
}


def test_every_way_to_be_broken_is_named_and_stops_nothing_else(folder: Path) -> None:
    put(folder, "helper", GOOD.format(cls="Helper", name="helper"))
    put(folder, "zzz_good")
    for name, (text, _) in BROKEN.items():
        if isinstance(text, bytes):
            (folder / f"{name}.py").write_bytes(text)
        else:
            put(folder, name, text)
    registry = discovered(folder)
    assert statuses(registry) == dict.fromkeys(BROKEN, "broken") | {
        "helper": "ok",
        "zzz_good": "ok",
    }
    for name, (_, message) in BROKEN.items():
        with pytest.raises(PluginError) as caught:
            registry.get("behavior", name)
        assert message in str(caught.value)
        (row,) = [row for row in registry.listing() if row["name"] == name]
        assert row["error"] == str(caught.value)
        assert f"{name}.py" in row["source"]
    assert len(registry.broken()) == len(BROKEN)
    folders = [m for m in sys.modules if m.startswith("navfw_folder_")]
    assert [m for m in folders if m.endswith((".raises", ".syntax"))] == []


def test_one_bad_class_of_a_file_leaves_the_others(folder: Path) -> None:
    text = "from navfw.plugins import plugin\n@plugin\nclass Bad: pass\n"
    put(folder, "mixed", text + GOOD.format(cls="Fine", name="fine"))
    assert statuses(discovered(folder)) == {"fine": "ok", "mixed": "broken"}


def test_private_classes_and_bases_in_a_file_are_helpers(folder: Path) -> None:
    put(
        folder,
        "file",
        '''
from navfw.kinds import Behavior

class _Hidden(Behavior): pass

class Common(Behavior):
    def propose(self, context): pass

class Left(Common):
    """Left."""
    name = "left"

class Right(Common):
    """Right."""
    name = "right"
''',
    )
    assert statuses(discovered(folder)) == {"left": "ok", "right": "ok"}


def test_a_complete_plugin_that_another_extends_is_a_plugin_too(folder: Path) -> None:
    more = '\nclass More(Thing):\n    """More."""\n    name = "more"\n'
    put(folder, "thing", GOOD.format(cls="Thing", name="thing") + more)
    assert statuses(discovered(folder)) == {"thing": "ok", "more": "ok"}


def test_plugins_of_other_kinds_and_imported_ones(folder: Path) -> None:
    put(
        folder,
        "mine",
        '''
from navfw.features.none import NoFeatures

class Some(NoFeatures):
    """Some."""
    name = "some"
''',
    )
    registry = discovered(folder)
    assert statuses(registry, "features") == {"some": "ok"}
    assert registry.names("behavior") == []


def test_files_may_import_their_helpers_and_find_their_data(folder: Path) -> None:
    put(folder, "_shared", "WORD = 'word'\n")
    (folder / "data.txt").write_text("data")
    text = "from ._shared import WORD\nfrom pathlib import Path\n"
    text += "DATA = Path(__file__).with_name('data.txt').read_text()\n"
    put(folder, "user", text + GOOD.format(cls="User", name="user"))
    cls = discovered(folder).get("behavior", "user")
    module = sys.modules[cls.__module__]
    assert (vars(module)["WORD"], vars(module)["DATA"]) == ("word", "data")


def test_equally_named_files_of_two_folders_do_not_meet(tmp_path: Path) -> None:
    registry = Registry()
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        put(tmp_path / name, "_shared", f"SIDE = {name!r}\n")
        text = f"from ._shared import SIDE\nassert SIDE == {name!r}\n"
        put(tmp_path / name, "same", text + GOOD.format(cls="Same", name=name))
        registry.discover_folder(tmp_path / name)
    assert statuses(registry) == {"left": "ok", "right": "ok"}


def test_a_folder_is_discovered_once(folder: Path) -> None:
    put(folder, "one", "print(1)\n" + GOOD.format(cls="One", name="one"))
    registry = discovered(folder)
    registry.discover_folder(folder)
    assert statuses(registry) == {"one": "ok"}
    assert registry.broken() == []


def test_what_a_file_prints_goes_to_stderr(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put(folder, "loud", "print('hello')\n" + GOOD.format(cls="Loud", name="loud"))
    discovered(folder)
    assert capsys.readouterr() == ("", "hello\n")


def test_control_c_is_not_swallowed(folder: Path) -> None:
    put(folder, "stop", "raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt):
        discovered(folder)


def test_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match="nowhere: expected a folder of plugins"):
        Registry().discover_folder(tmp_path / "nowhere")


# --- duplicates -----------------------------------------------------------------------------------


def test_the_later_of_a_name_is_broken_and_both_files_are_named(tmp_path: Path) -> None:
    registry = Registry()
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        put(tmp_path / name, "turn", cls=name.capitalize())
        registry.discover_folder(tmp_path / name)
    assert registry.get("behavior", "turn").__name__ == "First"
    (row,) = registry.broken()
    assert row["name"] == "turn"
    for part in (
        "second/turn.py: class Second: ",
        "first/turn.py",
        "give one of them another name",
    ):
        assert part in row["error"]
    assert [r["status"] for r in registry.listing()] == ["ok", "broken"]


def test_registering_a_taken_name_raises(folder: Path) -> None:
    put(folder, "mine")
    registry = discovered(folder)
    with pytest.raises(PluginError, match="the behavior name 'mine' is taken already"):
        registry.register(Mine)
    assert registry.get("behavior", "mine").__name__ == "Thing"


def test_a_broken_one_gives_way_to_one_that_works(folder: Path) -> None:
    put(folder, "mine", "1 / 0")
    registry = discovered(folder)
    registry.register(Mine)
    assert registry.get("behavior", "mine") is Mine
    assert sorted(row["status"] for row in registry.listing()) == ["broken", "ok"]
    assert len(registry.broken()) == 1


# --- entry points and built-in --------------------------------------------------------------------


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An importable module that tells when it is imported."""
    file = tmp_path / "elsewhere_plugins.py"
    text = "print('imported')\nclass Deep: pass\n"
    file.write_text(text + GOOD.format(cls="Hover", name="hover"))
    with monkeypatch.context() as patch:
        patch.syspath_prepend(str(tmp_path))
        yield "elsewhere_plugins"
    sys.modules.pop("elsewhere_plugins", None)


def point(value: str, name: str = "hover", group: str = "navfw.behaviors") -> EntryPoint:
    return EntryPoint(name, value, group)


def test_entry_points_are_loaded_when_asked_for(
    package: str, capsys: pytest.CaptureFixture[str]
) -> None:
    registry = Registry()
    registry.discover_entry_points([point(f"{package}:Hover")])
    assert registry.names("behavior") == ["hover"]
    assert package not in sys.modules
    assert registry.get("behavior", "hover").name == "hover"
    assert registry.get("behavior", "hover").name == "hover"
    assert capsys.readouterr() == ("", "imported\n")
    assert registry.listing()[0]["source"] == "entry point navfw.behaviors"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("{}:Hoover", "elsewhere_plugins has no 'Hoover'; did you mean 'Hover'?"),
        ("{}_none:Hover", "cannot be imported: ModuleNotFoundError"),
        ("{}:Deep", "not derived from a kind of plugin"),
        ("{}", "expected a class"),
    ],
)
def test_a_broken_entry_point_is_named(package: str, value: str, message: str) -> None:
    registry = Registry()
    registry.discover_entry_points(
        [
            point(value.format(package)),
            point("navfw.features.none:NoFeatures", "none", "navfw.features"),
        ]
    )
    with pytest.raises(PluginError, match=r"hover|Hover|elsewhere") as caught:
        registry.get("behavior", "hover")
    assert message in str(caught.value)
    assert statuses(registry) == {"hover": "broken"}
    assert statuses(registry, "features") == {"none": "ok"}


def test_an_entry_point_must_keep_its_promise(package: str) -> None:
    registry = Registry()
    registry.discover_entry_points([point(f"{package}:Hover", "fly")])
    registry.discover_entry_points([point(f"{package}:Hover", "hover", "navfw.flows")])
    with pytest.raises(
        PluginError, match="announced as behavior 'fly', but the class is behavior 'h"
    ):
        registry.get("behavior", "fly")
    with pytest.raises(PluginError, match="announced as flow 'hover', but the class is behavior"):
        registry.get("flow", "hover")


def test_an_entry_point_with_a_taken_name(package: str) -> None:
    registry = Registry()
    registry.register(Mine)
    registry.discover_entry_points([point(f"{package}:Hover", "mine")])
    assert registry.get("behavior", "mine") is Mine
    (row,) = registry.broken()
    assert "entry point navfw.behaviors: the behavior name 'mine' is taken" in row["error"]


def test_groups_are_one_for_each_kind() -> None:
    assert sorted(GROUPS.values()) == sorted(KINDS)
    assert {"navfw.behaviors", "navfw.flows", "navfw.features"} <= set(GROUPS)


def test_installed_entry_points_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def entry_points(group: str) -> list[EntryPoint]:
        asked.append(group)
        return [point("nowhere:Hover")] if group == "navfw.behaviors" else []

    monkeypatch.setattr(registry_module, "entry_points", entry_points)
    registry = default_registry()
    assert sorted(asked) == sorted(GROUPS)
    assert "hover" in registry.names("behavior")
    with pytest.raises(PluginError, match="nowhere"):
        registry.get("behavior", "hover")


def test_all_that_ships_works() -> None:
    registry = default_registry()
    assert registry.names("flow") == sorted(BUILT_IN["flow"])
    shipped = [
        row for row in registry.listing() if row["source"].startswith(("navfw", "behaviors"))
    ]
    assert [(row["name"], row["error"]) for row in shipped if row["error"]] == []
    assert {"avoid", "follow_wall", "emergency", "go_to_xy"} <= set(registry.names("behavior"))
    assert {row["kind"] for row in shipped} == set(KINDS)
    undescribed = [
        (row["name"], parameter["name"])
        for row in shipped
        for parameter in row["parameters"]
        if not parameter["description"]
    ]
    assert undescribed == []


def test_extra_folders_are_discovered_too(folder: Path) -> None:
    put(folder, "one")
    put(folder, "avoid")
    registry = default_registry([folder])
    assert "one" in registry.names("behavior")
    assert [row["name"] for row in registry.broken()] == ["avoid"]


def test_making_a_registry_imports_no_simulator_and_no_built_in() -> None:
    code = (
        "import sys\nfrom navfw.plugins import Registry, BUILT_IN\nr = Registry()\n"
        "for kind, plugins in BUILT_IN.items():\n"
        "    for name, target in plugins.items():\n"
        "        r.register_lazily(kind, name, target, 'navfw')\n"
        "print([m for m in sys.modules if m in {'pybullet', 'cv2', 'numba', 'navfw.flow.dis'}])"
    )
    done = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
