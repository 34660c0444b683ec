"""The plugins that ship with navfw, and where installed packages name theirs; imports none."""

from __future__ import annotations

import inspect
from importlib.metadata import EntryPoint, entry_points

BUILT_IN: dict[str, dict[str, str]] = {
    "behavior": {"navground": "navfw.mofis.navground:Navground"},
    "composite": {},
    "flow": {
        "block_matching": "navfw.flow.block_matching:BlockMatching",
        "dis": "navfw.flow.dis:Dis",
        "farneback": "navfw.flow.farneback:Farneback",
        "ideal": "navfw.flow.ideal:Ideal",
        "lucas_kanade": "navfw.flow.lucas_kanade:LucasKanade",
        "registered": "navfw.flow.registered:Registered",
    },
    "perception": {"offis": "navfw.offis.offis:Offis"},
    "features": {
        "aruco": "navfw.features.aruco:Aruco",
        "landmarks": "navfw.features.combined_landmarks:Landmarks",
        "none": "navfw.features.no_features:NoFeatures",
        "posters": "navfw.features.posters:Posters",
    },
    "localizer": {
        "bayes": "navfw.localization.bayes:Bayes",
        "dead_reckoning": "navfw.localization.dead_reckoning:DeadReckoning",
        "ekf": "navfw.localization.ekf:Ekf",
        "floor_plan": "navfw.localization.floor_plan:FloorPlanLocalizer",
        "topological": "navfw.localization.topological:Topological",
    },
    "planner": {"papfis": "navfw.papfis.papfis:Papfis"},
    "fusion": {
        "fuzzy": "navfw.mofis.fusion.fuzzy:FuzzyFusion",
        "priority": "navfw.mofis.fusion.priority:PriorityFusion",
        "damn": "navfw.mofis.fusion.damn:DamnFusion",
        "blend": "navfw.mofis.fusion.blend:BlendFusion",
        "pareto": "navfw.mofis.fusion.pareto:ParetoFusion",
    },
    "controller": {"unicycle": "navfw.locom.unicycle:Unicycle"},
    "landmark": {
        "aruco": "navfw.features.landmark_appearance:ArucoMarker",
        "poster": "navfw.features.landmark_appearance:Poster",
    },
    "event": {"blackout": "navfw.missions.composed_events:Blackout"},
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
    installed = entry_points()  # reads the metadata of all packages, so once for all groups
    return [point for group in GROUPS for point in installed.select(group=group)]


def summary_of(docstring: str | None) -> str:
    """The first paragraph of a docstring on one line."""
    return inspect.cleandoc(docstring or "").strip().split("\n\n")[0].replace("\n", " ")
