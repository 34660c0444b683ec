"""The registry of the shipped plugins, and additions to it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from plugins_samples import put

from navfw.interfaces import KINDS
from navfw.plugins import BUILT_IN, default_registry


def test_all_shipped_plugins_work() -> None:
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


def test_a_new_registry_imports_neither_simulator_nor_built_in_plugins() -> None:
    code = (
        "import sys\nfrom navfw.plugins import Registry, BUILT_IN\nr = Registry()\n"
        "for kind, plugins in BUILT_IN.items():\n"
        "    for name, target in plugins.items():\n"
        "        r.register_lazily(kind, name, target, 'navfw')\n"
        "unwanted = {'pybullet', 'cv2', 'numba', 'navfw.flow.dense_flow'}\n"
        "print([m for m in sys.modules if m in unwanted])"
    )
    done = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
