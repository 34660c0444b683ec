"""Why this command: each behaviour's share in it, and the rules that spoke for and against."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from navfw.interfaces import Composite
from navfw.mofis.command_grid import CommandGrid
from navfw.signals import Command, Proposal

__all__ = ["explain_command"]


def explain_command(
    command: Command,
    proposals: Mapping[str, Proposal],
    grid: CommandGrid,
    composite: Composite | None = None,
    weights: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """The command as plain data, with what every behaviour said of it.

    For each behaviour: its applicability, how much it desired this command, how much it forbade
    it, its reason, and the rules that fired for it with their strengths, strongest first. With a
    ``composite``, the ``weights`` it gave the primitives, and why.
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
