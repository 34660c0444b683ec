"""The reward of a step: a sum of terms, from the simulator's truth and the mission's outcome."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field

from navfw.config.document import YamlDocument
from navfw.config.strict_model import StrictModel
from navfw.config.yamlfile import validate
from navfw.missions.outcome import Outcome
from navfw.missions.progress_checkers import GoalChecker
from navfw.missions.session import Session
from navfw.signals import Pose


class RewardWeights(StrictModel):
    """The weight of each term of the reward."""

    progress: Annotated[
        float, Field(description="of each metre by which the way through all goals gets shorter")
    ] = 1.0
    time: Annotated[float, Field(description="of each second")] = -0.1
    reached: Annotated[float, Field(description="once, if the mission succeeds")] = 10.0
    collided: Annotated[float, Field(description="once, at a collision or fall")] = -10.0
    failed: Annotated[
        float, Field(description="once, if the mission ends otherwise, but for its time limit")
    ] = -5.0

    @classmethod
    def of(cls, given: Mapping[str, float]) -> RewardWeights:
        """The weights in ``given``; those left out have their defaults.

        Raises:
            ConfigError: there is no such term, or a weight is no number.

        """
        return validate(YamlDocument("reward", dict(given)), cls)


def reward_terms(
    weights: RewardWeights, progress: float, time: float, outcome: Outcome | None
) -> dict[str, float]:
    """Each term of the reward of a step that took ``time`` [s] and brought ``progress`` [m].

    ``outcome`` is the mission's, or None if it goes on.
    """
    terms = {"progress": weights.progress * progress, "time": weights.time * time}
    if outcome is not None and outcome.succeeded:
        terms["reached"] = weights.reached
    elif outcome is Outcome.COLLIDED:
        terms["collided"] = weights.collided
    elif outcome is not None and outcome is not Outcome.TIMEOUT:
        terms["failed"] = weights.failed
    return terms


class RemainingWay:
    """The length [m] of the shortest way through the goals that are left, from the true pose.

    Doors that an event closes count as they are at the start.
    """

    def __init__(self, session: Session) -> None:
        task = session.task
        radius = task.robot.radius
        self._checker = GoalChecker(task.goals, task.success_radius)
        self._fields = [
            session.plan.distance_field((goal.x, goal.y), radius) for goal in task.goals
        ]
        legs = [
            field.at(goal.x, goal.y)
            for (goal, _), field in zip(pairwise(task.goals), self._fields[1:], strict=True)
        ]
        self._behind = [sum(legs[index:]) for index in range(len(task.goals))]

    def update(self, pose: Any) -> float:
        """The length from the true ``pose`` (3,): x, y [m], yaw [rad]."""
        here = Pose(*(float(value) for value in pose))
        self._checker.update(here)
        index = min(self._checker.next, len(self._fields) - 1)
        return self._fields[index].at(here.x, here.y) + self._behind[index]
