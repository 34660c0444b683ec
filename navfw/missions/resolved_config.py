"""The configuration of a run with all defaults, as result and recording have it."""

from __future__ import annotations

import json
from typing import Any, Protocol

from navfw.missions.missionfile import MissionFile
from navfw.recording.run_folder import plain_json
from navfw.stack import Stack


class DescribedRun(Protocol):
    """What describes a run (``navfw.missions.session.Session``)."""

    @property
    def world_name(self) -> str: ...  # noqa: D102
    @property
    def mission_name(self) -> str: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def mission(self) -> MissionFile: ...  # noqa: D102
    @property
    def stack(self) -> Stack: ...  # noqa: D102


def resolved_config(mission: MissionFile, stack: Stack) -> dict[str, Any]:
    """Mission and stack of a run with all defaults, as plain data."""
    spec = mission.spec.model_dump(mode="json")
    start = mission.start
    return {
        "mission": {
            **spec,
            "sensors": mission.spec.sensors.resolved().model_dump(mode="json"),
            "start": [start.x, start.y, start.yaw],
            "start_known": mission.start_known,
            "goals": [{"place": goal.place, "x": goal.x, "y": goal.y} for goal in mission.goals],
            "map": mission.topo_map.name,
        },
        "stack": stack.config,
    }


def run_description(session: DescribedRun) -> dict[str, str]:
    """What a recording tells of its run: names, seed, and the resolved configuration as JSON."""
    return {
        "world": session.world_name,
        "mission": session.mission_name,
        "seed": str(session.seed),
        "config": json.dumps(plain_json(resolved_config(session.mission, session.stack))),
    }
