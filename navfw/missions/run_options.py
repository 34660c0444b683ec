"""What the options of a run choose: its stack, and changed values of mission and stack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from navfw.config.lookup import find
from navfw.config.overrides import Override, parse_override
from navfw.errors import UnknownNameError
from navfw.missions.missionfile import MissionFile
from navfw.robot.robotfile import robot_section

_DEFAULT_STACK, _FLOOR_PLAN_STACK = "default", "floor_plan"
"""The stack of a mission that names none, and the one if its map has a floor plan."""

_MISSION_PARTS = ("robot", "sensors")
"""Keys of a mission file that overrides may begin with; others need ``mission.`` before them."""


def chosen_stack(mission: MissionFile, stack: str | Path | None = None) -> Path:
    """The file of ``stack``; without one, of the stack that the mission names.

    If it names none, it is ``floor_plan`` where its map has a floor plan, else ``default``.

    Raises:
        UnknownNameError: there is no stack of that name; for the mission's, the message has its
            file and line.

    """
    if stack is not None:
        return find("stack", stack)
    unnamed = _DEFAULT_STACK if mission.topo_map.floor_plan is None else _FLOOR_PLAN_STACK
    with mission.document.locating(("stack",), only=UnknownNameError):
        return find("stack", mission.spec.stack or unnamed)


def split_overrides(overrides: Sequence[str]) -> tuple[list[Override], list[str]]:
    """Overrides for the mission file, and the others, which are for the stack.

    ``robot=NAME`` chooses the robot, in place of all that the mission says of it.

    >>> mission, stack = split_overrides(["mission.timeout=9", "robot.radius=1", "dis.x=1"])
    >>> [override.path for override in mission], stack
    ([('timeout',), ('robot', 'radius')], ['dis.x=1'])

    Raises:
        ConfigError: one is malformed.

    """
    for_mission: list[Override] = []
    for_stack: list[str] = []
    for text in overrides:
        override = parse_override(text)
        if override.path[0] == "mission" and len(override.path) > 1:
            for_mission.append(Override(override.path[1:], override.value, override.text))
        elif override.path == ("robot",):
            for_mission.append(replace(override, value=robot_section(override.value)))
        elif override.path[0] in _MISSION_PARTS:
            for_mission.append(override)
        else:
            for_stack.append(text)
    return for_mission, for_stack
