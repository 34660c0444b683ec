"""The explanation of a command: each behaviour's share in it, and the rules that fired."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from navfw.context import CommandGrid
from navfw.interfaces import Composite
from navfw.signals import Command, Proposal

__all__ = ["explain_command"]


def explain_command(
    command: Command,
    proposals: Mapping[str, Proposal],
    grid: CommandGrid,
    composite: Composite | None = None,
    weights: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """The command as plain data, with the rating of it by every behaviour.

    For each behaviour: applicability, desirability and prohibition of this command, the reason, and
    the rules that fired for it, strongest first. With a ``composite``: the ``weights`` of the
    primitives, and the rules that fired for them.
    """
    row, column = grid.nearest(command.twist)
    explanation = {
        "time": command.time,
        "v": command.twist.v,
        "w": command.twist.w,
        "leader": command.leader,
        "reason": command.reason,
        "emergency": command.emergency,
        "behaviors": {
            name: {
                "applicability": float(proposal.applicability),
                "weight": float(command.weights.get(name, 0.0)),
                "desirability": float(proposal.desirability[row, column]),
                "prohibition": float(proposal.prohibition[row, column]),
                "reason": proposal.reason,
                "rules": [dict(rule) for rule in proposal.explain(row, column)],
            }
            for name, proposal in proposals.items()
        },
    }
    if composite is not None:
        explanation["composite"] = {
            "name": composite.name,
            "weights": {name: float(weight) for name, weight in (weights or {}).items()},
            "rules": [dict(rule) for rule in composite.explain()],
        }
    return explanation
