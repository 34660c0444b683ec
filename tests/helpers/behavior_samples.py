"""Shipped behaviours and composites by name, and the twist that a proposal desires."""

from typing import Any, cast

from navfw.context import Context
from navfw.interfaces import Behavior, Composite
from navfw.plugins import default_registry
from navfw.robot import RobotModel
from navfw.signals import Proposal, Twist
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene

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


def scene(v: float = 0.3, **scene: Any) -> Context:
    """The last context of a drive straight on [m/s] in a ``BehaviorScene``."""
    return contexts_of(BehaviorScene("drive", Twist(v, 0.0), **scene))[-1]


def desired_twist(context: Context, proposal: Proposal) -> Twist:
    """The centre of the commands that ``proposal`` desires."""
    desire = proposal.desirability
    return Twist(
        float((desire * context.commands.v[:, None]).sum() / desire.sum()),
        float((desire * context.commands.w[None, :]).sum() / desire.sum()),
    )


def twist_of(behavior: Behavior | str, context: Context) -> Twist:
    """The twist that a behaviour, or a new one of that name, desires in ``context``."""
    made = behavior_of(behavior) if isinstance(behavior, str) else behavior
    return desired_twist(context, made.propose(context))
