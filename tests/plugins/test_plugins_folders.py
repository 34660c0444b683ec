"""Plugins from folders, and stack files that choose plugins: discovery, bases, errors."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from cli_calls import put_file
from hypothesis import given
from hypothesis import strategies as st
from plugin_rows import broken_rows
from plugins_samples import GOOD, discovered, put, statuses

from navfw.config import find, list_files
from navfw.config.document import parse_yaml
from navfw.config.overrides import layered
from navfw.errors import InputError, PluginError
from navfw.interfaces import Behavior
from navfw.plugins import Registry, default_registry, plugin_import
from navfw.process.interruption import interruptible
from navfw.robot import RobotModel
from navfw.stack import load_stack


def test_a_folder_is_discovered(folder: Path) -> None:
    put(folder, "one")
    put(folder, "two", GOOD.format(cls="A", name="a") + GOOD.format(cls="B", name="b"))
    put(folder, "_helper", "raise RuntimeError")
    put_file(folder, "notes.txt", "not python")
    registry = discovered(folder)
    assert statuses(registry) == {"one": "ok", "a": "ok", "b": "ok"}
    assert isinstance(registry.get("behavior", "one")(RobotModel()), Behavior)
    row = registry.listing()[2]
    assert row["summary"] == "Thing does a thing."
    assert row["source"].endswith("behaviors/one.py")


BROKEN: dict[str, tuple[str | bytes, str]] = {
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
    "empty": (
        "",
        "empty.py: no plugin in this file; derive a class from navfw.interfaces.Behavior",
    ),
    "wrong_base": ("class Turn: pass\n", "no plugin in this file (it has Turn); derive a class"),
    "no_name": (
        GOOD.format(cls="Turn", name="x").replace('name = "x"', ""),
        "class Turn: no name; write",
    ),
    "incomplete": (
        "from navfw.interfaces import Behavior\n"
        "class T(Behavior):\n    'T.'\n    name = 'incomplete'\n",
        "incomplete.py:2: class T: missing propose(self, context)",
    ),
    "decorated": (
        "from navfw.plugins import plugin\n\n@plugin\nclass Turn:\n    name = 'decorated'\n",
        "class Turn: not derived from a base class of plugins",
    ),
    "not_utf8": (b"a = '\xff'\n", "cannot be imported: SyntaxError"),
    "nulls": (b"a = 1\0\n", "cannot be imported: "),
}


def test_broken_files_are_listed_and_do_not_affect_others(folder: Path) -> None:
    put(folder, "helper", GOOD.format(cls="Helper", name="helper"))
    put(folder, "zzz_good")
    for name, (text, _) in BROKEN.items():
        put(folder, name, text)
    registry = discovered(folder)
    sound = {"helper": "ok", "zzz_good": "ok"}
    assert statuses(registry) == dict.fromkeys(BROKEN, "broken") | sound
    for name, (_, message) in BROKEN.items():
        with pytest.raises(PluginError) as caught:
            registry.get("behavior", name)
        assert message in str(caught.value)
        (row,) = [row for row in registry.listing() if row["name"] == name]
        assert row["error"] == str(caught.value)
        assert f"{name}.py" in row["source"]
    assert len(broken_rows(registry)) == len(BROKEN)
    folders = [m for m in sys.modules if m.startswith("navfw_folder_")]
    assert [m for m in folders if m.endswith((".raises", ".syntax"))] == []


def test_an_invalid_class_does_not_affect_others_of_its_file(folder: Path) -> None:
    text = "from navfw.plugins import plugin\n@plugin\nclass Bad: pass\n"
    put(folder, "mixed", text + GOOD.format(cls="Fine", name="fine"))
    assert statuses(discovered(folder)) == {"fine": "ok", "mixed": "broken"}


def test_private_classes_and_bases_in_a_file_are_helpers(folder: Path) -> None:
    text = "from navfw.interfaces import Behavior\nclass _Hidden(Behavior): pass\n"
    text += "class Common(Behavior):\n    def propose(self, context): pass\n"
    for name in ("Left", "Right"):
        text += f"class {name}(Common):\n    'Text.'\n    name = {name.lower()!r}\n"
    put(folder, "file", text)
    assert statuses(discovered(folder)) == {"left": "ok", "right": "ok"}


def test_a_complete_plugin_with_a_subclass_is_a_plugin_too(folder: Path) -> None:
    more = '\nclass More(Thing):\n    """More."""\n    name = "more"\n'
    put(folder, "thing", GOOD.format(cls="Thing", name="thing") + more)
    assert statuses(discovered(folder)) == {"thing": "ok", "more": "ok"}


def test_plugins_of_other_kinds_and_imported_ones(folder: Path) -> None:
    text = "from navfw.features.recognizers import NoFeatures\n\nclass Some(NoFeatures):\n"
    put(folder, "mine", f"{text}    'Some.'\n    name = 'some'\n")
    registry = discovered(folder)
    assert statuses(registry, "features") == {"some": "ok"}
    assert registry.names("behavior") == []


def test_files_may_import_their_helpers_and_find_their_data(folder: Path) -> None:
    put(folder, "_shared", "WORD = 'word'\n")
    put_file(folder, "data.txt", "data")
    text = "from ._shared import WORD\nfrom pathlib import Path\n"
    text += "DATA = Path(__file__).with_name('data.txt').read_text()\n"
    put(folder, "user", text + GOOD.format(cls="User", name="user"))
    cls = discovered(folder).get("behavior", "user")
    module = sys.modules[cls.__module__]
    assert (vars(module)["WORD"], vars(module)["DATA"]) == ("word", "data")


def test_files_of_the_same_name_in_two_folders_do_not_collide(tmp_path: Path) -> None:
    registry = Registry()
    for name in ("left", "right"):
        put(tmp_path / name, "_shared", f"SIDE = {name!r}\n")
        text = f"from ._shared import SIDE\nassert SIDE == {name!r}\n"
        put(tmp_path / name, "same", text + GOOD.format(cls="Same", name=name))
        registry.discover_folder(tmp_path / name)
    assert statuses(registry) == {"left": "ok", "right": "ok"}


def test_a_folder_is_discovered_once_and_what_it_prints_goes_to_stderr(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put(folder, "loud", "print('hello')\n" + GOOD.format(cls="Loud", name="loud"))
    registry = discovered(folder)
    registry.discover_folder(folder)
    assert statuses(registry) == {"loud": "ok"}
    assert broken_rows(registry) == []
    assert capsys.readouterr() == ("", "hello\n")


def test_control_c_is_not_swallowed(folder: Path) -> None:
    put(folder, "stop", "import os, signal\nos.kill(os.getpid(), signal.SIGTERM)\n")
    with interruptible(), pytest.raises(KeyboardInterrupt):
        discovered(folder)


def test_an_import_that_hangs_is_ended(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugin_import, "IMPORT_LIMIT", 0.3)
    put(folder, "slow", "import time\ntime.sleep(1000)\n")
    [broken] = broken_rows(discovered(folder))
    assert "no result within 0.3 s" in broken["error"]


def test_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match="nowhere: expected a folder of plugins"):
        Registry().discover_folder(tmp_path / "nowhere")


# --- stack files ----------------------------------------------------------------------------------


REGISTRY = default_registry()


def shipped(name: str) -> dict[str, Any]:
    return load_stack(find("stack", name), REGISTRY).as_data()


@pytest.mark.parametrize("name", [file.name for file in list_files("stack")])
def test_every_shipped_stack_loads(name: str) -> None:
    assert shipped(name)["behaviors"]


def test_variations_of_the_default_stack_differ_in_few_keys() -> None:
    default = shipped("default")
    for name, keys in {
        "oracle": {"flow", "oracle"},
        "poles": {"stixels", "warmup", "commands"},
        "pedestrians": {"commands"},
        "patrol": {"composite", "behaviors"},
        "search": {"composite", "behaviors", "planner"},
    }.items():
        assert {key for key, value in shipped(name).items() if default[key] != value} == keys
    assert list(default["flow"]) == ["block_matching"]
    assert shipped("patrol")["behaviors"] == {**default["behaviors"], "cruise": {"weight": 0.5}}


def test_only_two_shipped_stacks_use_the_simulators_truth() -> None:
    oracles = {file.name for file in list_files("stack") if shipped(file.name)["oracle"]}
    assert oracles == {"oracle", "navground"}


def test_stages_are_replaced_and_settings_and_behaviours_joined(tmp_path: Path) -> None:
    one = "base: default\nflow: {dis: }\nbehaviors: {avoid: {weight: 0.3}, cruise: }\n"
    put_file(tmp_path, "one.yaml", f"{one}local_map: {{margin: 0.1}}\n")
    two = "base: ./one.yaml\nlocal_map: {occupancy: {decay: 9}}\n"
    stack = load_stack(put_file(tmp_path, "two.yaml", two), REGISTRY)
    assert stack.stages["flow"].name == "dis"
    assert stack.behaviors["avoid"].params.model_dump()["weight"] == 0.3
    assert {"go_to_xy", "cruise"} <= set(stack.behaviors)
    assert (stack.settings.local_map.margin, stack.settings.local_map.occupancy.decay) == (0.1, 9.0)
    over = load_stack(tmp_path / "two.yaml", REGISTRY, ["occupancy.decay=7", "cruise.weight=0.1"])
    assert over.settings.local_map.occupancy.decay == 7.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("base: defalt\n", r"mine\.yaml:1: base: unknown stack 'defalt': did you mean 'default'"),
        ("base: ./mine.yaml\n", r"mine\.yaml:1: base: the stack is based on itself"),
        ("base: ./none.yaml\n", r"mine\.yaml:1: base: .*no such file"),
        ("base: 3\n", r"mine\.yaml:1: base: expected text"),
        ("base: default\n\nsafety: {gop: 1}\n", r"mine\.yaml:3: safety\.gop: .*'gap'"),
        ("base: default\nbehaviors: {avoid: {wait: 1}}\n", r"mine\.yaml:2: .*wait"),
        ("base: default\nflow: {ideal: }\n", r"mine\.yaml:2: flow: .*oracle: true"),
    ],
)
def test_errors_name_the_file_and_line_of_the_upper_stack(
    tmp_path: Path, text: str, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        load_stack(put_file(tmp_path, "mine.yaml", text), REGISTRY)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("flow:\n", "flow:\n  dis:\n", "flow: expected one plugin, as 'name: {parameters}' or"),
        ("flow:\n", "flow:\n  dis:\n", "; got dis, block_matching"),
        ("planner:\n  papfis:\n", "planner:\n", "planner: expected one plugin, "),
        ("planner:\n  papfis:\n", "planner: papfis\n", "'name:'; got none"),
        ("planner:\n  papfis:\n", "", "planner: missing"),
        (
            "  peek:\n",
            "  peak:\n",
            "behaviors: unknown behavior plugin 'peak': did you mean 'peek'",
        ),
        ("  peek:\n", "  peek: 3\n", "behaviors.peek: expected a mapping or null, got 3"),
        ("  peek:\n", "  peek: {depht: 3}\n", "behaviors.peek.depht: unknown key"),
        ("behaviors:\n", "behaviors:\nextra:\n", "behaviors: expected plugins, each as 'name: {"),
        ("fusion:\n", "fussion:\n", "fussion: unknown key; did you mean 'fusion'?"),
    ],
)
def test_errors_name_the_wrong_choice(old: str, new: str, says: str, tmp_path: Path) -> None:
    text = find("stack", "default").read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(InputError, match=rf"mine\.yaml:.*{re.escape(says)}"):
        load_stack(put_file(tmp_path, "mine.yaml", text.replace(old, new, 1)), REGISTRY)


LEAVES = st.integers(0, 9)
TREES = st.dictionaries(
    st.sampled_from("abc"), st.one_of(LEAVES, st.dictionaries(st.sampled_from("xyz"), LEAVES))
)


@given(TREES, TREES)
def test_layers_are_merged_and_the_upper_one_takes_precedence(
    low: dict[str, object], high: dict[str, object]
) -> None:
    lower, upper = (parse_yaml(repr(tree), name) for tree, name in ((low, "l"), (high, "h")))
    joined = layered(lower, upper, replaced={"c"})
    for key in low | high:
        one, other = low.get(key), high.get(key)
        both = isinstance(one, dict) and isinstance(other, dict) and key != "c"
        expected = {**one, **other} if both else other if key in high else one  # type: ignore[dict-item]
        assert joined.data[key] == expected
        if key in high:
            assert joined.origin_of((key,)).file == "h"
    assert set(joined.data) == set(low) | set(high)
    assert lower.data == low, "the layers stay as they are"
