"""The explanation of a command as text, as ``navfw explain`` and failed mission tests show it."""

from __future__ import annotations

from typing import Any


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
        given = ", ".join(f"{name} {weight:.2f}" for name, weight in composite["weights"].items())
        lines.append(f"  {composite['name']} weights {given}")
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in composite["rules"]]
    ordered = sorted(explanation["behaviors"].items(), key=lambda item: -item[1]["weight"])
    for name, part in ordered:
        lines.append(
            f"  {name}: weight {part['weight']:.2f}, desirability {part['desirability']:.2f}, "
            f"prohibition {part['prohibition']:.2f} - {part['reason']}"
        )
        lines += [f"      {rule['strength']:.2f}  {rule['rule']}" for rule in part["rules"]]
    return lines
