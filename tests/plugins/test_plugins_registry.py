"""Plugins registered in code, and names that are already taken."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from plugins_samples import Mine, discovered, put

from navfw.errors import PluginError, UnknownNameError
from navfw.features import NoFeatures
from navfw.interfaces import Behavior
from navfw.plugins import Registry, default_registry, plugin, plugin_import


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
        "summary": "Detects nothing.",
        "parameters": [],
        "notes": [],
        "error": None,
    }


def test_a_class_may_be_registered_again() -> None:
    registry = Registry()
    registry.register(Mine)
    registry.register(Mine)
    assert len(registry.listing()) == 1


def test_an_invalid_class_raises_on_registration() -> None:
    registry = Registry()
    with pytest.raises(PluginError, match="not derived from a base class of plugins"):
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
    monkeypatch.setattr(plugin_import, "_decorated", {})
    assert plugin(Mine) is Mine
    assert default_registry().get("behavior", "mine") is Mine


def test_the_decorator_raises_for_an_invalid_class() -> None:
    with pytest.raises(PluginError, match="no docstring"):

        @plugin
        class Bad(Behavior):
            name = "bad"

            def propose(self, context: Any) -> Any:
                del context


def test_of_two_plugins_of_one_name_the_later_is_broken(tmp_path: Path) -> None:
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
        "rename one of them",
    ):
        assert part in row["error"]
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
    assert len(registry.broken()) == 1
