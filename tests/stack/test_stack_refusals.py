"""What does not suit is refused when a stack is made or started, with its file; later it fails."""

from __future__ import annotations

import pytest
from stack_samples import GOAL, LINE, ROBOT, START, RecordingPlanner, drive, registry, sample_stack

from navfw.config import find
from navfw.errors import ConfigError, InputError
from navfw.signals import Belief, Waypoint
from navfw.stack import Stack


class RefusingPlanner(RecordingPlanner):
    """Refuses every update."""

    name = "refusing_planner"

    def update(self, belief: Belief) -> Waypoint | None:
        """Never gives a waypoint."""
        raise InputError("no way")


def test_parameters_that_do_not_suit_the_robot_are_told_with_the_stack_file() -> None:
    file = find("stack", "default")
    with pytest.raises(ConfigError, match="cannot divide the image height") as caught:
        Stack.load(file, ROBOT, LINE, registry(), ["flow.block_matching.rows=7"])
    assert file.name in str(caught.value.file)


def test_a_plugin_may_refuse_in_the_first_step_and_fails_in_those_after_it() -> None:
    stack = sample_stack()
    stack.planner.plugin = RefusingPlanner(ROBOT)
    stack.start(START, [GOAL])
    with pytest.raises(InputError, match="no way"):
        drive(stack, 0.02)
    stack.planner.plugin = RecordingPlanner(ROBOT)
    stack.start(START, [GOAL])
    simulator = drive(stack, 0.02)
    stack.planner.plugin = RefusingPlanner(ROBOT)
    drive(stack, 0.2, simulator)
    assert any("no way" in fault for fault in stack.state.faults)
