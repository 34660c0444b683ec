"""The plugins that ship with navfw, entry point groups, and plugin summaries from source code.

No plugin is imported for that.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from navfw.config.input_file import read_input
from navfw.config.installed_packages import file_of
from navfw.errors import ConfigError

DECORATED: dict[tuple[str, str], type[Any]] = {}
"""The classes decorated with ``plugin`` outside of plugin folders, by module and name."""

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
    "planner": {
        "explorer": "navfw.papfis.explorer:Explorer",
        "papfis": "navfw.papfis.papfis:Papfis",
    },
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

Shipped behaviours are files in ``behaviors/``; listed here are plugins that import more than the
public names of navfw.
"""

_PLURALS = {"features": "features", "family": "families"}

GROUPS: dict[str, str] = {f"navfw.{_PLURALS.get(kind, kind + 's')}": kind for kind in BUILT_IN}
"""Entry point groups of other packages: ``navfw.behaviors``, ``navfw.flows``, ..."""


_FOLDER = Path(__file__).parents[2]


def outlines(file: Path) -> list[tuple[str, str, str]]:
    """Return kind, name and summary of the behaviours and composites in a file, from its source.

    Empty if the file cannot be parsed. The file is not imported.
    """
    return [
        (
            "composite" if ast.unparse(cls.bases[0]).endswith("Composite") else "behavior",
            name,
            summary_of(ast.get_docstring(cls)),
        )
        for cls in _classes(file)
        for node in cls.body
        for name in _names_in(node)
    ]


def outlined_summary(target: str) -> str:
    """Read the summary of the class at ``module:Class`` from its source; "" if not found."""
    module, _, name = target.partition(":")
    ours = _FOLDER.joinpath(*module.split(".")).with_suffix(".py")
    file = ours if ours.is_file() else file_of(module)  # which imports the packages above it
    classes = () if file is None or file.suffix != ".py" else _classes(file)
    return next((summary_of(ast.get_docstring(cls)) for cls in classes if cls.name == name), "")


def summary_of(docstring: str | None) -> str:
    """Return the first paragraph of a docstring on one line."""
    return inspect.cleandoc(docstring or "").strip().split("\n\n")[0].replace("\n", " ")


def _classes(file: Path) -> list[ast.ClassDef]:
    try:
        tree = ast.parse(read_input(file), str(file))
    except (ConfigError, SyntaxError, ValueError):  # the import says what is wrong
        return []
    return [node for node in tree.body if isinstance(node, ast.ClassDef)]


def _names_in(node: ast.stmt) -> Iterator[str]:
    match node:
        case ast.AnnAssign(target=ast.Name(id="name"), value=ast.Constant(str(name))):
            yield name
