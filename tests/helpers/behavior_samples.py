"""Shipped behaviours and composites by name, and the twist that a proposal desires."""

from __future__ import annotations

from typing import cast

from navfw.context import Context
from navfw.interfaces import Behavior, Composite
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Proposal, Twist

ROBOT = RobotModel()
REGISTRY = default_registry()


def behavior_of(name: str) -> Behavior:
    """The behaviour with default parameters, at the start of a run."""
    behavior = cast(Behavior, REGISTRY.get("behavior", name)(ROBOT))
    behavior.reset()
    return behavior


def composite_of(name: str) -> Composite:
    """The composite with default parameters, at the start of a run."""
    composite = cast(Composite, REGISTRY.get("composite", name)(ROBOT))
    composite.reset()
    return composite


def desired_twist(context: Context, proposal: Proposal) -> Twist:
    """The centre of the commands that ``proposal`` desires."""
    desire = proposal.desirability
    return Twist(
        float((desire * context.commands.v[:, None]).sum() / desire.sum()),
        float((desire * context.commands.w[None, :]).sum() / desire.sum()),
    )
