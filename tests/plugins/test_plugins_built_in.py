"""The registry of the shipped plugins, and additions to it."""

from __future__ import annotations

from pathlib import Path

import pytest
from plugins_samples import put
from processes import printed

from navfw.cli.listings import overview
from navfw.interfaces import KINDS
from navfw.plugins import BUILT_IN, default_registry


def test_all_shipped_plugins_work_and_the_overview_reads_the_same_of_their_source() -> None:
    assert list(BUILT_IN) == list(KINDS)
    registry = default_registry()
    rows = overview()
    assert rows == [{name: row[name] for name in rows[0]} for row in registry.listing()]
    assert registry.names("flow") == sorted(BUILT_IN["flow"])
    shipped = [
        row for row in registry.listing() if row["source"].startswith(("navfw", "behaviors"))
    ]
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
        "unwanted = {'pybullet', 'cv2', 'numba', 'navfw.flow.dense_flow'}\n"
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
    assert [row["name"] for row in registry.broken()] == ["avoid"]
    (folder.parent / "navfw.toml").touch()
    monkeypatch.chdir(folder.parent)
    rows = overview()
    assert [row["name"] for row in rows if "parameters" in row] == ["avoid", "one"]
    (broken,) = (row for row in rows if row["error"])
    assert (broken["source"], "already taken" in broken["error"]) == ("behaviors/avoid.py", True)


def test_the_overview_verifies_all_where_a_shipped_file_cannot_be_parsed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(folder, "bad", "def f(:\n")
    monkeypatch.setattr("navfw.plugins.built_in.shipped_folder", lambda: folder.parent)
    monkeypatch.setattr("navfw.config.lookup.shipped_folder", lambda: folder.parent)
    (broken,) = (row for row in overview() if row["error"])
    assert (broken["name"], "SyntaxError" in broken["error"]) == ("bad", True)
