"""Give a page the decisions of a recorded run, with the rules that it edits."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.extras import extra_imports
from navfw.config.input_file import open_input, real_path, shown_path
from navfw.errors import InputError
from navfw.mofis.rules import BehaviorRules, RuledBehavior, RuledComposite, replace_rules
from navfw.numerics import Array
from navfw.numerics.arrays import spans
from navfw.recording import channel_list as topics
from navfw.recording.decision_moment import DecisionMoment, copy_of
from navfw.recording.recorded_decisions import RecordedDecisions
from navfw.recording.recorded_rules import recorded_rule_bases, rule_differences
from navfw.recording.recorded_run import RecordedRun
from navfw.recording.ros_messages import message_types
from navfw.recording.run_folder import read_result, recording_in
from navfw.recording.what_if import PAUSE, others
from navfw.signals import Proposal

_MAX_AGE = 1.0
"""Largest age [s] of the camera image that is shown with a decision."""


class RulesRun:
    """The recorded run in ``folder``, whose stack uses rules with the name of ``rules``.

    ``replaced(rules)`` yields the commands of all decisions with other rules of that name.

    Raises:
        InputError: the folder is not that of a run with ``--record``, is damaged, or by an older
            navfw; its stack has no rules of that name.

    """

    def __init__(self, folder: Path, rules: BehaviorRules) -> None:
        self.folder, self._decisions = folder, RecordedDecisions(folder)
        self.replaced = self._decisions.replaced
        self._times: list[float] = self._decisions.times.tolist()
        if not self._times:
            what = "is cut off, or has no recorded decisions; record the run again by this navfw"
            raise InputError(what, file=folder)
        mofis = self._decisions.mofis
        plugins = {one.name: one for one in (mofis.composite, *mofis.behaviors.values()) if one}
        replace_rules(map(copy_of, plugins.values()), rules)  # raises for another name
        self._owner, self._plugin = next(
            (name, one)
            for name, one in plugins.items()
            if isinstance(one, RuledBehavior | RuledComposite)
            and one.rules.base.name == rules.base.name
        )
        self._recorded = 0, self._decisions.moment(0)
        self._others = rule_differences(
            recorded_rule_bases(RecordedRun(recording_in(folder))), mofis
        )

    def about(self) -> dict[str, Any]:
        """Return the data that time does not change: commands, their grid, fusion, other rules.

        ``others`` are the lines in which the files of rules differ from those recorded.
        """
        grid = self._decisions.mofis.commands
        names = [*self._decisions.mofis.behaviors]
        fusion = read_result(self.folder)["config"]["stack"]["fusion"]
        ((kind, settings),) = fusion.items()
        return {
            "times": self._times,
            **_columns(self._decisions.commands),
            "grid": {"names": names, "v": grid.v.tolist(), "w": grid.w.tolist()},
            "fusion": {**(settings or {}), "name": kind},
            "others": self._others,
        }

    def moment(
        self, time: float, rules: BehaviorRules | None, shown: int
    ) -> tuple[dict[str, Any], dict[str, float]]:
        """Decide again at ``time`` [s], with ``rules`` if given; return a page's data, and inputs.

        The camera picture is left out if the page has it: if the decision has the index ``shown``.

        Raises:
            InputError: the run has no decision then, or other inputs or outputs than the rules.

        """
        first, last = self._times[0], self._times[-1]
        if not first - 1e-6 <= time <= last + 1e-6:
            raise InputError(f"{time:g} s is outside of the run: {first:.1f} to {last:.1f} s")
        index = int(np.searchsorted(self._decisions.times, time + 1e-6)) - 1
        if index != self._recorded[0]:
            self._recorded = index, self._decisions.moment(index)
        moment = self._recorded[1] if rules is None else self._with(rules)
        command, proposals = moment.decide()
        inputs = moment.inputs(moment.mofis.commands.nearest(command.twist))
        none = moment.mofis.commands.zeros()
        failed = Proposal(applicability=0.0, desirability=none, prohibition=none, reason="failed")
        rated = [proposals.get(name, failed) for name in moment.mofis.behaviors]
        said = {
            "v": command.twist.v,
            "w": command.twist.w,
            "leader": command.leader,
            "reason": command.reason,
            "weights": {name: float(weight) for name, weight in command.weights.items()},
            "applicability": {name: float(one.applicability) for name, one in proposals.items()},
        }
        picture = {} if index == shown else {"picture": self._picture(self._times[index])}
        decided = picture | {
            "index": index,
            "time": self._times[index],
            "desirability": _packed([one.desirability for one in rated]),
            "prohibition": _packed([one.prohibition for one in rated]),
            "command": said,
        }
        return decided, {one.name: value for owner, one, value in inputs if owner == self._owner}

    def differences(self, commands: Sequence[tuple[float, float]]) -> dict[str, Any]:
        """Return all ``commands``, and the spans [s] in which they differ from recorded ones."""
        table, times = np.array(commands), self._times
        where = spans(self._decisions.times, others(table, self._decisions.commands), PAUSE)
        return _columns(table) | {"where": [(times[begin], times[end]) for begin, end in where]}

    def check_drivable(self, file: Path) -> None:
        """Raise InputError if the run's stack reads its rules from another file than ``file``."""
        read = self._plugin.rules_file()
        if real_path(file) != real_path(read):
            what = f"is not what {self._owner} reads: {shown_path(read)}; edit that file"
            raise InputError(what, file=shown_path(file))

    def _with(self, rules: BehaviorRules) -> DecisionMoment:
        """Return the decision that was asked for last, with ``rules``."""
        moment = self._recorded[1]
        behaviors, composite = dict(moment.behaviors), moment.composite
        if self._owner in behaviors:
            behaviors[self._owner] = copy_of(behaviors[self._owner])
        else:
            composite = copy_of(composite)
        replace_rules((*behaviors.values(), composite), rules)
        return DecisionMoment(moment.mofis, moment.context, behaviors, composite)

    def _picture(self, time: float) -> str:
        """Return the newest camera image at ``time`` [s] as a data URL; "" if there is none."""
        with extra_imports("record"):
            from mcap.reader import SeekingReader

        begin, end = topics.nanoseconds(max(time - _MAX_AGE, 0.0)), topics.nanoseconds(time) + 1
        with open_input(recording_in(self.folder), topics.MAX_BYTES) as stream:
            for _, _, message in SeekingReader(stream).iter_messages(
                (topics.CAMERA_IMAGE,), starting_at=begin, ending_before=end, reverse=True
            ):
                image: Any = message_types().deserialize_cdr(message.data, topics.IMAGE_SCHEMA)
                code = base64.b64encode(bytes(image.data)).decode("ascii")
                return f"data:image/{image.format};base64,{code}"
        return ""


def _columns(commands: Array) -> dict[str, Any]:
    return {"v": commands[:, 0].tolist(), "w": commands[:, 1].tolist()}


def _packed(layers: Sequence[Array]) -> str:
    """Encode degrees of the commands, layer after layer, as bytes (0 to 255) in base64."""
    data = np.rint(255.0 * np.array(layers)).astype(np.uint8)
    return base64.b64encode(data.tobytes()).decode("ascii")
