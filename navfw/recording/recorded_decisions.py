"""Make recorded decisions again: run behaviours and fusion on the contexts of a run.

No image is read. Behaviours keep a state of their own from one decision to the next, so that the
contexts before a decision are run as well.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.input_file import open_input
from navfw.context import Context
from navfw.errors import InputError
from navfw.guard import PluginGuard
from navfw.interfaces import Behavior, Composite
from navfw.localmap import LocalMap
from navfw.mofis.explanation_text import rule_changes
from navfw.mofis.mofis import Mofis, explain_command
from navfw.mofis.rules import BehaviorRules, replace_rules
from navfw.plugins import default_registry
from navfw.recording import channel_list as topics
from navfw.recording.decision_message import decision_of
from navfw.recording.decision_moment import DecisionMoment, copy_of
from navfw.recording.explanations import explain_at
from navfw.recording.recorded_mission import recorded_mission
from navfw.recording.recorded_rules import recorded_rule_bases, rule_differences
from navfw.recording.run_folder import recording_in
from navfw.stack.stackfile import load_stack, mofis_of

_MEMORIES = 3.0, 30.0, 1e6
"""Times [s] that behaviours may remember, tried until the command is the recorded one."""
_KEPT = 50
"""Number of decisions between two states of the behaviours that are kept."""

_EQUAL = 1e-5
"""Difference [m/s, rad/s] below which two commands are considered the same."""
_LISTED = 6
"""Largest number of differences that are listed."""


class RecordedDecisions:
    """The decisions of a recorded run, at ``times`` (n,) [s], any of which can be made again.

    ``commands`` (n, 2) are v [m/s] and w [rad/s]. ``begin`` and ``end`` [s] limit the decisions
    that are read: behaviours then remember nothing from before. A recording by an older navfw has
    none.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged.

    """

    def __init__(self, folder: Path, begin: float = 0.0, end: float = math.inf) -> None:
        robot = recorded_mission(folder).robot.with_reduced_images()
        stages = "composite", "fusion"
        config = load_stack(folder / "stack.yaml", default_registry(), stages=stages)
        local_map = LocalMap(robot, config.settings.local_map)
        self.mofis = mofis_of(config, robot, PluginGuard(), local_map)
        self.contexts: list[Context] = []
        rows = []
        for message in _messages(recording_in(folder), begin, end):
            context, twist = decision_of(message, robot, self.mofis.commands)
            self.contexts.append(context)
            rows.append((context.time, twist.v, twist.w))
        table = np.array(rows, dtype=np.float64).reshape(-1, 3)
        self.times, self.commands = table[:, 0], table[:, 1:]
        self.mofis.reset()
        self._next = 0
        self._states = {0: _copies(self.mofis)}

    def moment(self, index: int) -> DecisionMoment:
        """Return the decision at ``times[index]``, to be made again."""
        start = max(kept for kept in self._states if kept <= index)
        if not start <= self._next <= index:
            self._next = start
            self._begin_at(self.mofis, start)
        while self._next < index:
            self.mofis.decide_in(self.contexts[self._next])
            self._next += 1
            if self._next % _KEPT == 0:
                self._states.setdefault(self._next, _copies(self.mofis))
        return DecisionMoment(self.mofis, self.contexts[index], *_copies(self.mofis))

    def replaced(self, rules: BehaviorRules) -> Iterator[tuple[float, float]]:
        """Yield each decision's v [m/s], w [rad/s] with ``rules`` in place of those of their name.

        Raises:
            InputError: no rule base of the stack has that name, or it has other inputs or outputs.

        """
        mofis = copy.copy(self.mofis)
        self._begin_at(mofis, 0)
        replace_rules((*mofis.behaviors.values(), mofis.composite), rules)
        for context in self.contexts:
            command = mofis.decide_in(context)
            yield (0.0, 0.0) if command is None else (command.twist.v, command.twist.w)

    def _begin_at(self, mofis: Mofis, kept: int) -> None:
        """Give ``mofis`` its plugins as they were before the decision of index ``kept``."""
        mofis.behaviors, mofis.composite = self._states[kept]
        mofis.behaviors, mofis.composite = _copies(mofis)


def _copies(mofis: Mofis) -> tuple[dict[str, Behavior], Composite | None]:
    """Return copies of the behaviours and the composite, with their present state."""
    behaviors = {name: copy_of(behavior) for name, behavior in mofis.behaviors.items()}
    return behaviors, None if mofis.composite is None else copy_of(mofis.composite)


def _messages(file: Path, begin: float, end: float) -> Iterator[bytes]:
    """Yield the decisions from ``begin`` to ``end`` [s], found by the index; none without one."""
    with extra_imports("record"):
        from mcap.exceptions import McapError
        from mcap.reader import SeekingReader

    with open_input(file, topics.MAX_BYTES) as stream, suppress(McapError, OSError, ValueError):
        begins, ends = topics.nanoseconds(begin), topics.nanoseconds(min(end, 1e6)) + 1
        messages = SeekingReader(stream).iter_messages(
            (topics.DECISION,), starting_at=begins, ending_before=ends
        )
        for _, _, message in messages:
            yield message.data


def moment_at(folder: Path, time: float) -> DecisionMoment:
    """Return the decision of a recorded run that was in force at ``time`` [s], to be made again.

    It is made on its recorded context; only if behaviours read more than that has, or the recording
    is older, by repeating the run up to there.

    Raises:
        InputError: the folder is not that of a run with ``--record``, or is damaged; no command
            was in force at that time; or the stack gives another one now.

    """
    recorded = explain_at(folder, time)
    decided = float(recorded["time"])
    for memory in _MEMORIES:
        decisions = RecordedDecisions(folder, decided - memory, decided)
        last = len(decisions.times) - 1
        if last < 0 or decisions.times[last] < decided - _EQUAL:
            break
        with suppress(AttributeError):  # of what the message of a decision lacks
            moment = decisions.moment(last)
            if _gives(moment, recorded):
                return moment
    moment = _repeated(folder, decided)
    if _gives(moment, recorded):
        return moment
    raise _otherwise(folder, recorded, moment)


def _otherwise(folder: Path, recorded: Mapping[str, Any], moment: DecisionMoment) -> InputError:
    """Return the error that a decision now differs from the ``recorded`` one."""
    from navfw.recording.recorded_run import RecordedRun

    command, proposals = moment.decide()
    v, w, twist = recorded["v"], recorded["w"], command.twist
    now = explain_command(command, proposals, moment.mofis)
    bases = recorded_rule_bases(RecordedRun(recording_in(folder)))
    other = rule_differences(bases, moment.mofis) or [*map(str, rule_changes(recorded, now))]
    return InputError(
        f"the command at {recorded['time']:.1f} s was {v:+.2f} m/s, {w:+.2f} rad/s, and is now"
        f" {twist.v:+.2f} m/s, {twist.w:+.2f} rad/s: navfw, a plugin or its rules changed since\n  "
        + "\n  ".join(other[:_LISTED]),
        file=folder,
    )


def _repeated(folder: Path, decided: float) -> DecisionMoment:
    """Repeat a recorded run up to the decision at ``decided`` [s]."""
    from navfw.recording.run_replay import recorded_stack

    stack, recording, step = recorded_stack(folder)
    for reading in recording.readings:
        last = reading.time >= decided - 1e-6
        if last:
            mofis = stack.mofis
            behaviors, composite = _copies(mofis)
        step(reading)
        if last and mofis.context is not None:
            return DecisionMoment(mofis, mofis.context, behaviors, composite)
    raise InputError(f"the decision at {decided:g} s is not in the recording", file=folder)


def _gives(moment: DecisionMoment, recorded: Mapping[str, Any]) -> bool:
    """Return whether the command is the recorded one, up to the digits of its explanation."""
    twist = moment.decide()[0].twist
    off = max(abs(twist.v - recorded["v"]), abs(twist.w - recorded["w"]))
    return bool(off < _EQUAL)
