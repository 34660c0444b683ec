"""Plugins that ship, or are registered in code or by installed packages; names that are taken."""

import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from plugin_rows import broken_rows
from plugins_samples import GOOD, Mine, discovered, put, statuses
from processes import printed

from navfw.errors import PluginError, UnknownNameError
from navfw.features.recognizers import NoFeatures
from navfw.interfaces import KINDS, Behavior, Plugin
from navfw.plugins import BUILT_IN, Registry, default_registry
from navfw.plugins.built_in import DECORATED, GROUPS
from navfw.plugins.plugin_import import plugin


def registered(*plugins: type[Plugin], points: Iterable[EntryPoint] = ()) -> Registry:
    registry = Registry()
    for cls in plugins:
        registry.register(cls)
    registry.discover_entry_points(points)
    return registry


def test_register_and_get() -> None:
    registry = registered(Mine)
    registry.register(NoFeatures, source="a test")
    assert registry.get("behavior", "mine") is Mine
    assert registry.get("features", "none") is NoFeatures
    assert registry.names("behavior") == ["mine"]
    (row,) = registry.listing("features")
    assert row.pop("parameters") == row.pop("notes") == []
    assert row == {
        "name": "none",
        "kind": "features",
        "status": "ok",
        "source": "a test",
        "summary": "Detects nothing.",
        "error": None,
    }


def test_a_class_may_be_registered_again_and_an_invalid_one_is_refused() -> None:
    registry = registered(Mine, Mine)
    with pytest.raises(PluginError, match="not derived from a base class of plugins"):
        registry.register(int)  # type: ignore[arg-type]
    assert len(registry.listing()) == 1


def test_unknown_names_get_the_nearest() -> None:
    registry = registered(Mine)
    with pytest.raises(UnknownNameError, match="unknown behavior plugin 'mime': did you mean 'mi"):
        registry.get("behavior", "mime")
    with pytest.raises(UnknownNameError, match="kind of plugin 'behaviour': did you mean 'beha"):
        registry.get("behaviour", "mine")
    with pytest.raises(UnknownNameError, match="unknown kind"):
        registry.listing("behaviour")


def test_the_decorator_reaches_default_registries() -> None:
    with patch.dict(DECORATED):
        assert plugin(Mine) is Mine
        assert default_registry().get("behavior", "mine") is Mine


def test_the_decorator_raises_for_an_invalid_class() -> None:
    with pytest.raises(PluginError, match="no docstring"):

        @plugin
        class Bad(Behavior):
            name = "bad"

            def propose(self, context: Any) -> Any:
                del context


def test_two_plugins_of_one_name_are_refused(tmp_path: Path) -> None:
    registry = Registry()
    for name in ("first", "second"):
        put(tmp_path / name, "turn", cls=name.capitalize())
        registry.discover_folder(tmp_path / name)
    with pytest.raises(PluginError, match=r"second/turn[.]py: class Second: .* already taken"):
        registry.get("behavior", "turn")  # neither is used in the place of the other
    (row,) = broken_rows(registry)
    assert row["name"] == "turn"
    for text in ("second/turn.py: class Second: ", "first/turn.py", "rename one of them"):
        assert text in row["error"]
    assert [r["status"] for r in registry.listing()] == ["ok", "broken"]


def test_registering_a_taken_name_raises(folder: Path) -> None:
    put(folder, "mine")
    registry = discovered(folder)
    with pytest.raises(PluginError, match="the behavior name 'mine' is already taken"):
        registry.register(Mine)
    assert registry.get("behavior", "mine").__name__ == "Thing"


def test_a_working_plugin_replaces_a_broken_one(folder: Path) -> None:
    put(folder, "mine", "1 / 0")
    registry = discovered(folder)
    registry.register(Mine)
    assert registry.get("behavior", "mine") is Mine
    assert sorted(row["status"] for row in registry.listing()) == ["broken", "ok"]
    assert len(broken_rows(registry)) == 1


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An importable module that records its import."""
    text = "print('imported')\nclass Deep: pass\n"
    put(tmp_path, "elsewhere_plugins", text + GOOD.format(cls="Hover", name="hover"))
    with monkeypatch.context() as patch:
        patch.syspath_prepend(str(tmp_path))
        yield "elsewhere_plugins"
    sys.modules.pop("elsewhere_plugins", None)


def point(value: str, name: str = "hover", group: str = "navfw.behaviors") -> EntryPoint:
    return EntryPoint(name, value, group)


def test_entry_points_are_loaded_on_first_use(
    package: str, capsys: pytest.CaptureFixture[str]
) -> None:
    registry = registered(points=[point(f"{package}:Hover")])
    assert registry.names("behavior") == ["hover"]
    assert package not in sys.modules
    for _ in range(2):
        assert registry.get("behavior", "hover").name == "hover"
    assert capsys.readouterr() == ("", "imported\n")
    assert registry.listing()[0]["source"] == "entry point navfw.behaviors"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("{}:Hoover", "elsewhere_plugins has no 'Hoover'; did you mean 'Hover'?"),
        ("{}_none:Hover", "cannot be imported: ModuleNotFoundError"),
        ("{}:Deep", "not derived from a base class of plugins"),
        ("{}", "expected a class"),
    ],
)
def test_a_broken_entry_point_is_named(package: str, value: str, message: str) -> None:
    sound = point("navfw.features.recognizers:NoFeatures", "none", "navfw.features")
    registry = registered(points=[point(value.format(package)), sound])
    with pytest.raises(PluginError, match=r"hover|Hover|elsewhere") as caught:
        registry.get("behavior", "hover")
    assert message in str(caught.value)
    assert statuses(registry) == {"hover": "broken"}
    assert statuses(registry, "features") == {"none": "ok"}


def test_an_entry_point_must_have_the_declared_kind_and_name(package: str) -> None:
    target = f"{package}:Hover"
    registry = registered(points=[point(target, "fly"), point(target, "hover", "navfw.flows")])
    for kind, name in (("behavior", "fly"), ("flow", "hover")):
        message = f"registered as {kind} '{name}', but the class is behavior 'hover'"
        with pytest.raises(PluginError, match=message):
            registry.get(kind, name)


def test_an_entry_point_with_a_taken_name(package: str) -> None:
    registry = registered(Mine, points=[point(f"{package}:Hover", "mine")])
    assert registry.get("behavior", "mine") is Mine
    (row,) = broken_rows(registry)
    assert "entry point navfw.behaviors: the behavior name 'mine' is already taken" in row["error"]


def test_installed_entry_points_are_discovered(monkeypatch: pytest.MonkeyPatch) -> None:
    others = point("nowhere:Other", "other", "console_scripts")
    flow = point("nowhere:Flow", "lucid", "navfw.flows")
    installed = EntryPoints([others, point("nowhere:Hover"), flow])
    monkeypatch.setattr("navfw.config.installed_packages.all_points", lambda: installed)
    assert sorted(GROUPS.values()) == sorted(KINDS)
    assert {"navfw.behaviors", "navfw.flows", "navfw.features"} <= set(GROUPS)
    registry = default_registry()
    assert "lucid" in registry.names("flow")
    assert not any("other" in registry.names(kind) for kind in GROUPS.values())
    assert "hover" in registry.names("behavior")
    with pytest.raises(PluginError, match="nowhere"):
        registry.get("behavior", "hover")


def test_all_shipped_plugins_work_and_the_listing_reads_the_same_of_their_source() -> None:
    assert list(BUILT_IN) == list(KINDS)
    registry = default_registry()
    rows = registry.listing(parameters=False)
    assert rows == [{name: row[name] for name in rows[0]} for row in registry.listing()]
    assert set(BUILT_IN["flow"]) < set(registry.names("flow"))
    ours = ("navfw", "behaviors")
    shipped = [row for row in registry.listing() if row["source"].startswith(ours)]
    assert [(row["name"], row["error"]) for row in shipped if row["error"]] == []
    assert [row["name"] for row in shipped if row["notes"]] == [], "they use no simulator"
    assert {"avoid", "follow_wall", "emergency", "go_to_xy"} <= set(registry.names("behavior"))
    assert {row["kind"] for row in shipped} == set(KINDS)
    undescribed = [
        (row["name"], parameter["name"])
        for row in shipped
        for parameter in row["parameters"]
        if not parameter["description"]
    ]
    assert undescribed == []


def test_a_new_registry_imports_neither_simulator_nor_built_in_plugins() -> None:
    code = (
        "import sys\nfrom navfw.plugins import Registry, BUILT_IN\nr = Registry()\n"
        "for kind, plugins in BUILT_IN.items():\n"
        "    for name, target in plugins.items():\n"
        "        r.register_lazily(kind, name, target, 'navfw')\n"
        "unwanted = {'pybullet', 'cv2', 'numba', 'navfw.flow.opencv_flow'}\n"
        "print([m for m in sys.modules if m in unwanted])"
    )
    assert printed(code) == "[]"


def test_extra_folders_and_those_of_a_project_are_verified(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(folder, "one")
    put(folder, "avoid")
    registry = default_registry([folder])
    assert "one" in registry.names("behavior")
    assert [row["name"] for row in broken_rows(registry)] == ["avoid"]
    (folder.parent / "navfw.toml").touch()
    monkeypatch.chdir(folder.parent)
    rows = default_registry().listing(parameters=False)
    assert [row["name"] for row in rows if "parameters" in row] == ["avoid", "one"]
    (broken,) = (row for row in rows if row["error"])
    assert (broken["source"], "already taken" in broken["error"]) == ("behaviors/avoid.py", True)


def test_a_shipped_file_that_cannot_be_parsed_is_listed_with_its_error(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(folder, "bad", "def f(:\n")
    for module in ("navfw.plugins.registry", "navfw.config.lookup"):
        monkeypatch.setattr(f"{module}.shipped_folder", lambda: folder.parent)
    rows = default_registry().listing(parameters=False)
    (broken,) = (row for row in rows if row["error"])
    assert (broken["name"], "SyntaxError" in broken["error"]) == ("bad", True)
