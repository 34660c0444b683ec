"""The plugins that ship with navfw, as their source says, and entry points of installed packages.

None of them is imported.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from navfw.config.input_file import read_input, shown_path
from navfw.config.installed_packages import file_of, points_of, source_of
from navfw.config.lookup import plugin_files, shipped_folder

BUILT_IN: dict[str, dict[str, str]] = {
    "behavior": {},
    "composite": {},
    "flow": {
        "block_matching": "navfw.flow.block_matching:BlockMatching",
        "dis": "navfw.flow.opencv_flow:Dis",
        "ideal": "navfw.flow.ideal:Ideal",
        "registered": "navfw.flow.registration:Registered",
    },
    "perception": {"offis": "navfw.offis.offis:Offis"},
    "features": {
        "aruco": "navfw.features.recognizers:Aruco",
        "none": "navfw.features.recognizers:NoFeatures",
    },
    "localizer": {
        "dead_reckoning": "navfw.localization.motion_model:DeadReckoning",
        "floor_plan": "navfw.localization.floor_plan:FloorPlanLocalizer",
        "topological": "navfw.localization.topological:Topological",
    },
    "planner": {"papfis": "navfw.papfis.papfis:Papfis"},
    "fusion": {
        "fuzzy": "navfw.mofis.fusion:FuzzyFusion",
    },
    "controller": {"unicycle": "navfw.locom.unicycle:Unicycle"},
    "landmark": {
        "aruco": "navfw.features.landmark_appearance:ArucoMarker",
    },
    "event": {"blackout": "navfw.missions.missionspec:Blackout"},
    "family": {
        "clutter": "navfw.worldgen.open_areas:Clutter",
        "corridors": "navfw.worldgen.corridors:Corridors",
        "maze": "navfw.worldgen.maze:Maze",
        "moving": "navfw.worldgen.open_areas:Moving",
        "poles": "navfw.worldgen.open_areas:Poles",
        "rooms": "navfw.worldgen.rooms:Rooms",
    },
}
"""The shipped plugins as ``module:Class``, by kind and name; imported on first use.

Shipped behaviours are files in ``behaviors/``; listed here are those that import more than the
public names of navfw.
"""

_PLURALS = {"features": "features", "family": "families"}

GROUPS: dict[str, str] = {f"navfw.{_PLURALS.get(kind, kind + 's')}": kind for kind in BUILT_IN}
"""Entry point groups of other packages: ``navfw.behaviors``, ``navfw.flows``, ..."""


def installed_points() -> list[EntryPoint]:
    """The entry points of installed packages in ``GROUPS``."""
    return [point for group in GROUPS for point in points_of(group)]


def installed_outlines(points: Iterable[EntryPoint]) -> list[dict[str, Any]]:
    """The plugins of installed packages as their source says, as far as it is found."""
    rows = []
    for point in points:
        file = file_of(point.module)
        classes = () if file is None or file.suffix != ".py" else _classes(file)
        for cls in (cls for cls in classes if cls.name == point.attr):
            rows.append(_outline(GROUPS[point.group], point.name, source_of(point), cls))
    return rows


def summary_of(docstring: str | None) -> str:
    """The first paragraph of a docstring on one line."""
    return inspect.cleandoc(docstring or "").strip().split("\n\n")[0].replace("\n", " ")


_PACKAGE = Path(__file__).parents[1]
_MAX_SOURCE = 1_000_000
"""Largest size of a shipped plugin's source [byte]."""


def shipped_outlines() -> list[dict[str, Any]]:
    """Name, kind, source and summary of each shipped plugin, in the order of kinds; no error.

    Raises:
        SyntaxError: a source cannot be parsed.

    """
    return in_order([*_outlines_of_modules(), *_outlines_of_behaviors()])


def in_order(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The ``rows`` of plugins in the order of kinds, and by name."""
    order = list(BUILT_IN)
    return sorted(rows, key=lambda row: (order.index(row["kind"]), row["name"]))


def _outlines_of_modules() -> Iterator[dict[str, Any]]:
    for kind, plugins in BUILT_IN.items():
        for name, target in plugins.items():
            module, _, class_name = target.partition(":")
            file = _PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py")
            (cls,) = (cls for cls in _classes(file) if cls.name == class_name)
            yield _outline(kind, name, "navfw", cls)


def _outlines_of_behaviors() -> Iterator[dict[str, Any]]:
    for file in plugin_files(shipped_folder() / "behaviors"):
        for cls in _classes(file):
            for node in cls.body:
                match node:
                    case ast.AnnAssign(target=ast.Name(id="name"), value=ast.Constant(str(name))):
                        is_composite = ast.unparse(cls.bases[0]).endswith("Composite")
                        kind = "composite" if is_composite else "behavior"
                        yield _outline(kind, name, shown_path(file), cls)


def _outline(kind: str, name: str, source: str, cls: ast.ClassDef) -> dict[str, Any]:
    summary = summary_of(ast.get_docstring(cls))
    return {"name": name, "kind": kind, "source": source, "summary": summary, "error": None}


def _classes(file: Path) -> list[ast.ClassDef]:
    tree = ast.parse(read_input(file, _MAX_SOURCE), str(file))
    return [node for node in tree.body if isinstance(node, ast.ClassDef)]
