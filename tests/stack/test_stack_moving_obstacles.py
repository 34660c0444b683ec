"""Tracked objects bar arcs like static ones, unless a behaviour handles moving obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from stack_samples import Idle, drive, sample_stack

from navfw.context import Context
from navfw.interfaces import Behavior
from navfw.plugins import inject_faults
from navfw.signals import Frame, MovingObject, Odometry, Proposal, Twist
from navfw.stack import View


class Careful(Idle):
    """Declares that it handles moving obstacles."""

    name = "careful"
    handles_moving_obstacles = True


class Failing(Careful):
    """Declares so, and then fails."""

    name = "failing"

    def propose(self, context: Context) -> Proposal:
        raise RuntimeError("no proposal")


def person_ahead(frame: Frame, odometry: Odometry) -> View:
    """A standing person straight ahead, 0.7 m from the camera."""
    person = MovingObject(frame.time, 0.0, 0.3, 0.7, np.zeros((2, 2)), np.zeros(2))
    return View(moving_objects=(person,))


def context_before_a_person(*behaviors: type[Behavior], fault_in: str | None = None) -> Context:
    """The context after three detections of a person ahead, before any percept."""
    stack = sample_stack(*behaviors, script=person_ahead)
    if fault_in is not None:
        inject_faults(stack.mofis.behaviors, fault_in)
    drive(stack, 0.25)
    assert stack.mofis.context is not None
    return stack.mofis.context


@pytest.mark.parametrize("behaviors", [(Idle,), (Idle, Careful)])
def test_tracks_bar_arcs_unless_a_behaviour_handles_them(
    behaviors: tuple[type[Behavior], ...],
) -> None:
    context = context_before_a_person(*behaviors)
    straight = context.commands.nearest(Twist(0.3, 0.0))
    barred = context.arcs.free[straight] < 0.8
    assert bool(barred) == (Careful not in behaviors)
    # either way the conflict is known, and the local goal leads past
    assert context.conflicts is not None
    assert context.local_goal is not None
    assert abs(context.local_goal.bearing) > 0.1


def test_a_behaviour_that_fails_handles_no_moving_obstacles() -> None:
    context = context_before_a_person(Idle, Failing)
    assert context.arcs.free[context.commands.nearest(Twist(0.3, 0.0))] < 0.8


def test_an_inactive_fault_injector_changes_nothing() -> None:
    context = context_before_a_person(Idle, Careful, fault_in="careful")
    assert context.arcs.free[context.commands.nearest(Twist(0.3, 0.0))] > 0.8
