"""The mission of a recorded run, as its result has it."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from navfw.config.yamlfile import rewording
from navfw.recording.run_folder import RESULT, read_result
from navfw.robot import RobotModel


class _Recorded(BaseModel):
    """A part of a result that a replay uses; other keys are not looked at."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _RecordedGoal(_Recorded):
    place: str
    x: float
    y: float


class RecordedMission(_Recorded):
    """The mission in a result, as far as it is used."""

    start: tuple[float, float, float]
    start_known: bool = True
    shadow: bool = False
    goals: tuple[_RecordedGoal, ...]
    tolerance: float
    robot: RobotModel


def recorded_mission(folder: Path) -> RecordedMission:
    """Return the mission of a recorded run.

    Raises:
        InputError: the folder is not that of a run, or is damaged.

    """
    config = read_result(folder).get("config")
    with rewording(prefix="config.mission.", file=folder / RESULT):
        data = config.get("mission") if isinstance(config, dict) else None
        return RecordedMission.model_validate(data)
