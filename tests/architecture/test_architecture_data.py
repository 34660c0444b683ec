"""Every shipped data file has a reader and is valid."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from architecture_sources import ROOT, shown

from navfw.config.document import load_yaml
from navfw.fuzzy import load_rule_base
from navfw.localization.place_probabilities import load_table
from navfw.missions.missionfile import load_mission
from navfw.plugins import default_registry
from navfw.robot import load_robot
from navfw.sim import load_world
from navfw.stack import load_stack
from navfw.stack.stack_document import read_stack
from navfw.suite import load_suite
from navfw.topomap import load_map
from navfw.topomap.occupancy_map import load_ros_map

READERS: dict[str, Callable[[Path], Any]] = {
    "behaviors/*.yaml": load_rule_base,
    "maps/*.yaml": load_map,
    "maps/plans/*.yaml": load_ros_map,
    "navfw/*/rules/*.yaml": load_rule_base,
    "navfw/localization/situations.yaml": load_table,
    "navfw/robot/robots/*.yaml": load_robot,
    "navfw/stack/stacks/*.yaml": lambda path: load_stack(path, default_registry()),
    "navfw/scaffold/templates/parts/*/rules.yaml": load_rule_base,
    "navfw/scaffold/templates/parts/s*.yaml": load_yaml,  # of a stack and a suite
    "navfw/scaffold/templates/project/behaviors/*.yaml": load_rule_base,
    "navfw/scaffold/templates/project/maps/*.yaml": load_map,
    # these name a behaviour and a map of the new project, found only there
    "navfw/scaffold/templates/project/stacks/*.yaml": read_stack,
    "navfw/scaffold/templates/project/worlds/*/missions/*.yaml": load_yaml,
    "navfw/scaffold/templates/project/worlds/*/world.yaml": load_world,
    "worlds/*/missions/*.yaml": load_mission,
    "worlds/*/world.yaml": load_world,
    "worlds/suites/*.yaml": load_suite,
}


@pytest.mark.parametrize("pattern", READERS)
def test_every_file_loads(pattern: str) -> None:
    for path in sorted(ROOT.glob(pattern)):
        assert READERS[pattern](path) is not None, path


def test_every_file_has_a_reader() -> None:
    read = {path for pattern in READERS for path in ROOT.glob(pattern)}
    folders = (ROOT / name for name in ("behaviors", "maps", "navfw", "worlds"))
    shipped = {path for folder in folders for path in folder.rglob("*.yaml")}
    assert {shown(path) for path in shipped - read} == set()
    for pattern in READERS:
        assert list(ROOT.glob(pattern)), f"no file matches {pattern}"
