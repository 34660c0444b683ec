"""The explanation of a command: each behaviour's share in it, and the rules that fired."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from navfw.guard import PluginCallError, PluginGuard, label_of
from navfw.guard.answers import items, mapping
from navfw.mofis.mofis import Mofis
from navfw.signals import Command, Proposal


def explanation_lines(explanation: dict[str, Any]) -> list[str]:
    """The lines: the command, what was perceived, then weights, reasons and rules.

    ``explanation`` is that of ``Stack.explain``. Behaviours come in the order of their weights.
    """
    perceived = explanation.get("perception", {}).get("sentence", "")
    lines = [
        f"at {explanation['time']:.1f} s: v {explanation['v']:+.2f} m/s, "
        f"w {explanation['w']:+.2f} rad/s, led by {explanation['leader']}",
        f"  perceived  {perceived or 'nothing yet'}",
    ]
    composite = explanation.get("composite", {"rules": ()})
    if composite["rules"]:
        weights = ", ".join(f"{name} {weight:.2f}" for name, weight in composite["weights"].items())
        lines.append(f"  {composite['name']} weights {weights}")
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in composite["rules"]]
    ordered = sorted(explanation["behaviors"].items(), key=lambda item: -item[1]["weight"])
    for name, rating in ordered:
        lines.append(
            f"  {name}: weight {rating['weight']:.2f}, desirability {rating['desirability']:.2f}, "
            f"prohibition {rating['prohibition']:.2f} - {rating['reason']}"
        )
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in rating["rules"]]
    return lines


def explain_command(
    command: Command,
    proposals: Mapping[str, Proposal],
    mofis: Mofis,
    guard: PluginGuard | None = None,
) -> dict[str, Any]:
    """The command as plain data, with the rating of it by every behaviour.

    For each behaviour: applicability, desirability and prohibition of this command, the reason, and
    the rules that fired for it, strongest first. With a composite: the weights of the primitives,
    and the rules that fired for them. A plugin that fails to explain gives no rules; the
    fault is noted by ``guard``, given none by that of ``mofis``.
    """
    guard = mofis.guard if guard is None else guard
    row, column = mofis.commands.nearest(command.twist)
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
                "rules": _rules(guard, f"behavior {name}", proposal.explain, row, column),
            }
            for name, proposal in proposals.items()
        },
    }
    if mofis.composite is not None:
        explanation["composite"] = {
            "name": mofis.composite.name,
            "weights": {name: float(weight) for name, weight in mofis.weights.items()},
            "rules": _rules(guard, label_of(mofis.composite), mofis.composite.explain),
        }
    return explanation


def _rules(
    guard: PluginGuard, plugin: str, explain: Callable[..., object], *command: int
) -> list[dict[str, Any]]:
    """The rules that a plugin says fired; none when it fails."""
    try:
        return guard.call(plugin, explain, *command, check=_check_rules)
    except PluginCallError:
        return []


def _check_rules(answer: object) -> list[dict[str, Any]]:
    return [mapping(rule, "a rule") for rule in items(answer, "explain's answer")]
