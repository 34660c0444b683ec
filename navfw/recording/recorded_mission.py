"""Read the mission of a recorded run from its result."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from navfw.config.yamlfile import rewording
from navfw.recording.run_folder import RESULT, read_result
from navfw.robot import RobotModel


class _Recorded(BaseModel):
    """A part of a result that a replay uses; other keys are ignored."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _RecordedGoal(_Recorded):
    place: str
    x: float
    y: float


class RecordedMission(_Recorded):
    """The mission in a run's result, with only the keys that a replay uses."""

    start: tuple[float, float, float]
    start_known: bool = True
    shadow: bool = False
    goals: tuple[_RecordedGoal, ...]
    tolerance: float
    robot: RobotModel


def recorded_mission(folder: Path) -> RecordedMission:
    """Read the mission of the run in ``folder`` from its result.

    Raises:
        InputError: the folder is not that of a run, or is damaged.

    """
    config = read_result(folder).get("config")
    with rewording(prefix="config.mission.", file=folder / RESULT):
        data = config.get("mission") if isinstance(config, dict) else None
        return RecordedMission.model_validate(data)
