"""Plugins of installed packages: loaded on first use, and checked against their entry point."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest
from plugins_samples import GOOD, Mine, statuses

from navfw.errors import PluginError
from navfw.interfaces import KINDS
from navfw.plugins import GROUPS, Registry, default_registry


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An importable module that records its import."""
    file = tmp_path / "elsewhere_plugins.py"
    text = "print('imported')\nclass Deep: pass\n"
    file.write_text(text + GOOD.format(cls="Hover", name="hover"))
    with monkeypatch.context() as patch:
        patch.syspath_prepend(str(tmp_path))
        yield "elsewhere_plugins"
    sys.modules.pop("elsewhere_plugins", None)


def point(value: str, name: str = "hover", group: str = "navfw.behaviors") -> EntryPoint:
    return EntryPoint(name, value, group)


def test_entry_points_are_loaded_on_first_use(
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
        ("{}:Deep", "not derived from a base class of plugins"),
        ("{}", "expected a class"),
    ],
)
def test_a_broken_entry_point_is_named(package: str, value: str, message: str) -> None:
    registry = Registry()
    registry.discover_entry_points(
        [
            point(value.format(package)),
            point("navfw.features.no_features:NoFeatures", "none", "navfw.features"),
        ]
    )
    with pytest.raises(PluginError, match=r"hover|Hover|elsewhere") as caught:
        registry.get("behavior", "hover")
    assert message in str(caught.value)
    assert statuses(registry) == {"hover": "broken"}
    assert statuses(registry, "features") == {"none": "ok"}


def test_an_entry_point_must_have_the_declared_kind_and_name(package: str) -> None:
    registry = Registry()
    registry.discover_entry_points([point(f"{package}:Hover", "fly")])
    registry.discover_entry_points([point(f"{package}:Hover", "hover", "navfw.flows")])
    with pytest.raises(
        PluginError, match="registered as behavior 'fly', but the class is behavior 'h"
    ):
        registry.get("behavior", "fly")
    with pytest.raises(PluginError, match="registered as flow 'hover', but the class is behavior"):
        registry.get("flow", "hover")


def test_an_entry_point_with_a_taken_name(package: str) -> None:
    registry = Registry()
    registry.register(Mine)
    registry.discover_entry_points([point(f"{package}:Hover", "mine")])
    assert registry.get("behavior", "mine") is Mine
    (row,) = registry.broken()
    assert "entry point navfw.behaviors: the behavior name 'mine' is already taken" in row["error"]


def test_groups_are_one_for_each_kind() -> None:
    assert sorted(GROUPS.values()) == sorted(KINDS)
    assert {"navfw.behaviors", "navfw.flows", "navfw.features"} <= set(GROUPS)


def test_installed_entry_points_are_discovered(monkeypatch: pytest.MonkeyPatch) -> None:
    others = EntryPoint("other", "nowhere:Other", "console_scripts")
    installed = EntryPoints(
        [others, point("nowhere:Hover"), point("nowhere:Flow", "lucid", "navfw.flows")]
    )
    monkeypatch.setattr("navfw.plugins.built_in.entry_points", lambda: installed)
    registry = default_registry()
    assert "lucid" in registry.names("flow")
    assert not any("other" in registry.names(kind) for kind in GROUPS.values())
    assert "hover" in registry.names("behavior")
    with pytest.raises(PluginError, match="nowhere"):
        registry.get("behavior", "hover")
