"""What if: run a changed stack on the recorded readings, and compare its commands.

The images are those of the path that was driven. How long they show what the changed stack would
have seen is found by integrating both series of commands from the first difference on.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from navfw.mofis.explanation_text import RuleChange, rule_changes
from navfw.mofis.rules import BehaviorRules, replace_rules
from navfw.numerics import Array, Mask
from navfw.numerics.arrays import spans
from navfw.recording import channel_list as topics
from navfw.recording.recorded_run import RecordedRun
from navfw.recording.run_folder import recording_in
from navfw.recording.run_replay import recorded_stack
from navfw.signals import Pose, Twist
from navfw.stack.shadow_stack import was_driven

PAUSE = 0.5
"""Time [s] between two spans of differences below which they count as one."""

_OTHER = np.array([0.01, 0.02])
"""Differences of v [m/s] and w [rad/s] from which two commands count as different."""

_LISTED = 20
"""Largest number of differences that are printed, the longest ones."""

_REASONS = 3
"""Largest number of reasons that are printed."""


@dataclass(frozen=True, slots=True)
class OtherCommands:
    """A span from ``time`` to ``until`` [s] in which commands differ, at its largest difference.

    ``recorded`` and ``changed`` are v [m/s] and w [rad/s] there, ``why`` is the behaviour and the
    rule whose strength has changed the most by the first of these decisions.
    """

    time: float
    until: float
    recorded: tuple[float, float]
    changed: tuple[float, float]
    why: str


@dataclass(frozen=True, slots=True)
class OtherVeto:
    """The safety monitor held one of the two robots from ``time`` to ``until`` [s]."""

    time: float
    until: float
    reason: str


@dataclass(frozen=True, slots=True)
class WhatIf:
    """The commands of the changed stack on the readings of a run, compared with the recorded ones.

    ``first`` [s] is the time of its first other command, None if all are the same; ``share`` in [0,
    1] is that of the ticks with other commands. ``reasons`` are the rules and weights that changed
    the most at these decisions, with their share of them, the most frequent first. From ``apart``
    [s] on both paths are farther apart than the robot's ``radius`` [m]: from then on the images are
    not those that it would have seen. ``complete`` is False if the recording ends before its run
    did. ``twists`` (n, 2) are all its commands, at ``times`` (n,) [s].
    """

    first: float | None
    share: float
    duration: float
    apart: float | None
    radius: float
    differences: tuple[OtherCommands, ...]
    reasons: tuple[tuple[str, float], ...]
    vetoes_new: tuple[OtherVeto, ...]
    vetoes_gone: tuple[OtherVeto, ...]
    complete: bool
    times: Array = field(repr=False, compare=False)
    twists: Array = field(repr=False, compare=False)

    def as_data(self) -> dict[str, Any]:
        """Return all fields but ``times`` and ``twists`` as JSON data."""
        data = asdict(self)
        return {name: value for name, value in data.items() if name not in ("times", "twists")}


def what_if(
    folder: Path,
    overrides: Sequence[str] = (),
    stack: str | None = None,
    rules: Sequence[Path] = (),
) -> WhatIf:
    """Run the stack of a recorded run, changed, on its readings, and compare its commands.

    ``overrides`` are as for ``navfw run --set``; ``stack`` is another one, by name or file; each
    file of ``rules`` replaces the rule base of its name.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged; there is no
            such stack, plugin, parameter or rule base.

    """
    changed, recording, step = recorded_stack(folder, stack, overrides)
    for file in rules:
        plugins = *changed.mofis.behaviors.values(), changed.mofis.composite
        replace_rules(plugins, BehaviorRules(file), file)
    recorded = _recorded(RecordedRun(recording_in(folder)))
    twists = np.zeros((len(recording), 2))
    held: list[str] = []
    reasons: dict[float, RuleChange] = {}
    for index, reading in enumerate(recording.readings):
        twist = step(reading)
        twists[index] = twist.v, twist.w
        held.append(changed.state.veto)
        differs = bool(others(twists[index], recording.commands[index]))
        if differs:
            was_driven(changed, Twist(*recording.commands[index].tolist()))
        if differs and reading.frame is not None:
            before = recorded.get(topics.nanoseconds(reading.time), {})
            changes = rule_changes(before, changed.explain(inference=False))
            if changes:
                reasons[reading.time] = changes[0]
    times = recording.times
    differ = others(twists, recording.commands)
    held_before = _held_at(times, recorded)
    return WhatIf(
        first=float(times[differ.argmax()]) if differ.any() else None,
        share=float(differ.mean()) if len(differ) else 0.0,
        duration=float(times[-1]) if len(times) else 0.0,
        apart=_apart(times, recording.commands, twists, changed.robot.radius),
        radius=changed.robot.radius,
        differences=tuple(
            _difference(times, recording.commands, twists, span, reasons)
            for span in spans(times, differ, PAUSE)
        ),
        reasons=tuple(
            (text, count / len(reasons))
            for text, count in Counter(one.what for one in reasons.values()).most_common()
        ),
        vetoes_new=tuple(_vetoes(times, held, held_before)),
        vetoes_gone=tuple(_vetoes(times, held_before, held)),
        complete=recording.complete,
        times=times,
        twists=twists,
    )


def others(commands: Array, recorded: Array) -> Mask:
    """Return which ``commands`` (..., 2), v [m/s] and w [rad/s], differ from those recorded."""
    return np.asarray((np.abs(commands - recorded) >= _OTHER).any(axis=-1))


# --- comparing -----------------------------------------------------------------------------------


def _recorded(run: RecordedRun) -> dict[int, dict[str, Any]]:
    """Return rules, and why the robot was held, of each recorded decision by its time [ns]."""
    decisions: dict[int, dict[str, Any]] = {}
    for message in run.messages(topics.COMMAND, topics.RULES):
        at = decisions.setdefault(topics.nanoseconds(message.time), {})
        if message.topic == topics.RULES:
            at |= message.content
        else:
            at["held"] = message.content.get("held", "")
    return decisions


def _held_at(times: Array, recorded: Mapping[int, Mapping[str, Any]]) -> list[str]:
    """Return why the recorded robot was held, at each of ``times`` [s]; "" if it was not."""
    held, last = [], ""
    for time in times.tolist():
        at = recorded.get(topics.nanoseconds(time))
        last = last if at is None else str(at.get("held", last))
        held.append(last)
    return held


def _difference(
    times: Array,
    recorded: Array,
    changed: Array,
    span: tuple[int, int],
    reasons: Mapping[float, RuleChange],
) -> OtherCommands:
    first, last = span
    part = slice(first, last + 1)
    scale = np.maximum(np.abs(recorded).max(axis=0), 1e-6)
    most = first + int((np.abs(changed[part] - recorded[part]) / scale).sum(axis=1).argmax())
    begin, end = float(times[first]), float(times[last])
    why = next((str(one) for time, one in reasons.items() if begin <= time <= end), "")
    v, w = recorded[most].tolist()
    other_v, other_w = changed[most].tolist()
    return OtherCommands(begin, end, (v, w), (other_v, other_w), why)


def _vetoes(times: Array, held: Sequence[str], other: Sequence[str]) -> Iterator[OtherVeto]:
    """Yield the spans in which one robot is ``held``, and the ``other`` at no time."""
    flags = np.array([bool(reason) for reason in held], dtype=np.bool_)
    for first, last in spans(times, flags, PAUSE):
        if not any(other[first : last + 1]):
            yield OtherVeto(float(times[first]), float(times[last]), held[first])


def _apart(times: Array, recorded: Array, changed: Array, radius: float) -> float | None:
    """Return when two robots that start together and obey these are ``radius`` [m] apart."""
    poses = [Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0)]
    for index, (begin, end) in enumerate(pairwise(times.tolist())):
        for which, commands in enumerate((recorded, changed)):
            v, w = commands[index].tolist()
            turn, length = w * (end - begin), v * (end - begin)
            step = Pose(length * math.cos(0.5 * turn), length * math.sin(0.5 * turn), turn)
            poses[which] = poses[which].compose(step)
        one, other = poses
        if math.dist((one.x, one.y), (other.x, other.y)) > radius:
            return float(end)
    return None


def what_if_lines(result: WhatIf) -> list[str]:
    """Format ``result`` as lines of text."""
    cut = [] if result.complete else ["the recording ends before its run did"]
    if result.first is None:
        return [f"the same commands in all {result.duration:.1f} s", *cut]
    share = f"{100.0 * result.share:.0f} % of {result.duration:.1f} s"
    lines = [f"first other command at {result.first:.1f} s, other commands in {share}"]
    lines += [
        f"  {share:4.0%} by {what}" for what, share in result.reasons[:_REASONS] if share >= 0.05
    ]
    longest = sorted(result.differences, key=lambda one: one.time - one.until)[:_LISTED]
    for one in sorted(longest, key=lambda one: one.time):
        (v, w), (other_v, other_w) = one.recorded, one.changed
        commands = f"{v:+.2f} m/s, {w:+.2f} rad/s -> {other_v:+.2f} m/s, {other_w:+.2f} rad/s"
        why = f"; {one.why}" if one.why else ""
        lines.append(f"{one.time:7.1f} to {one.until:.1f} s  {commands}{why}")
    if len(result.differences) > _LISTED:
        lines.append(f"{len(result.differences) - _LISTED} shorter ones")
    for kind, vetoes in (("new", result.vetoes_new), ("gone", result.vetoes_gone)):
        lines += [
            f"{veto.time:7.1f} to {veto.until:.1f} s  veto {kind}: {veto.reason}" for veto in vetoes
        ]
    near = f"{result.radius:.2f} m"
    if result.apart is None:
        return [
            *lines,
            *cut,
            f"the paths stay within {near}: it would have seen much the same",
        ]
    when = f"from {result.apart:.1f} s on the paths would be more than {near} apart"
    return [*lines, *cut, f"{when}: the images are those of the recorded path, not of its own"]
