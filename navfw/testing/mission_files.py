"""Mission files as tests: ``pytest worlds`` drives those that ``navfw_missions`` names.

::

    [tool.pytest.ini_options]
    testpaths = ["tests", "worlds"]
    navfw_missions = ["worlds/*/missions/*.yaml"]

Each is driven once for each seed of ``--mission-seeds``, by default with seed 0, and passes if the
robot reaches its goals and no plugin faults.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from navfw.testing.mission_case import MissionCase, widened
from navfw.testing.session_runs import run_for


class NotReachedError(Exception):
    """The mission of a file did not reach its goals."""


class MissionYaml(pytest.File):
    """A mission file; its items are seeds."""

    seeds: tuple[int, ...] = ()

    def collect(self) -> Iterator[MissionItem]:
        """One item for each seed.

        Raises:
            CollectError: the mission, its world or its stack is wrong.

        """
        world = self.path.parents[1]
        named = str(world) if (world / "world.yaml").is_file() else world.name
        cases = [MissionCase(named, str(self.path), seed) for seed in widened([0], self.seeds)]
        if wrong := cases[0].check():
            raise self.CollectError(wrong)
        for case in cases:
            yield MissionItem.from_parent(self, name=f"seed{case.seed}", case=case)


class MissionItem(pytest.Item):
    """One drive of a mission file."""

    def __init__(self, *, case: MissionCase, **given: Any) -> None:
        super().__init__(**given)
        self.case = case

    def runtest(self) -> None:
        """Drive the mission; the hooks of the plugin check faults and report.

        Raises:
            NotReachedError: the goals were not reached.

        """
        run = run_for(self, self.case)
        if not run.outcome.succeeded:
            raise NotReachedError(f"{run.run.verdict}")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The outcome alone for a mission that did not reach its goals."""
        if isinstance(excinfo.value, NotReachedError):
            return f"expected the goal to be reached; {excinfo.value}"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        """The file and the name of the test."""
        return self.path, None, f"{self.path.stem}, {self.name}"
