"""Recorded decisions: made again without images, bit by bit, and with other rules."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap_rewriting import rewrite

from navfw.errors import InputError
from navfw.missions import MissionResult
from navfw.mofis.rules import BehaviorRules, RuledBehavior
from navfw.recording.channel_list import DECISION
from navfw.recording.recorded_decisions import RecordedDecisions, moment_at
from navfw.recording.run_folder import RECORDING


@pytest.fixture(scope="module")
def decisions(folder: Path) -> RecordedDecisions:
    return RecordedDecisions(folder)


def rules_of(decisions: RecordedDecisions, behavior: str) -> BehaviorRules:
    plugin = decisions.mofis.behaviors[behavior]
    assert isinstance(plugin, RuledBehavior)
    return plugin.rules


def test_each_decision_made_again_gives_the_recorded_command_bit_by_bit(
    driven: tuple[MissionResult, Path], decisions: RecordedDecisions
) -> None:
    assert len(decisions.times) >= 45
    again = list(decisions.replaced(rules_of(decisions, "avoid")))
    np.testing.assert_array_equal(np.array(again), decisions.commands)


@pytest.mark.parametrize("order", [(40, 3, 27, 27, 0), (0, 1, 44)])
def test_moments_may_be_asked_for_in_any_order(
    decisions: RecordedDecisions, order: tuple[int, ...]
) -> None:
    for index in order:
        twist = decisions.moment(index).decide()[0].twist
        assert (twist.v, twist.w) == tuple(decisions.commands[index])


def test_other_rules_give_other_commands(decisions: RecordedDecisions) -> None:
    base = rules_of(decisions, "go_to_xy").base
    assert base.file is not None
    text = Path(base.file).read_text()
    slow = BehaviorRules.parse(text.replace("speed IS full", "speed IS slow"))
    changed = np.array(list(decisions.replaced(slow)))
    assert changed[:, 0].mean() < decisions.commands[:, 0].mean() - 0.05
    np.testing.assert_array_equal(
        np.array(list(decisions.replaced(rules_of(decisions, "go_to_xy")))), decisions.commands
    )
    other = BehaviorRules.parse(text.replace("name: go_to_xy", "name: go_to_yx"))
    with pytest.raises(InputError, match="did you mean 'go_to_xy'"):
        next(decisions.replaced(other))


def test_without_recorded_decisions_the_run_is_repeated(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / RECORDING).unlink()
    rewrite(
        folder / RECORDING,
        copy / RECORDING,
        lambda topic, data: None if topic == DECISION else data,
    )
    assert not len(RecordedDecisions(copy).times)
    assert moment_at(copy, 2.4).decide()[0].twist == moment_at(folder, 2.4).decide()[0].twist


def test_rules_that_are_others_now_are_listed_line_by_line(
    folder: Path, tmp_path: Path, decisions: RecordedDecisions, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = rules_of(decisions, "go_to_xy").base
    assert base.file is not None
    text = Path(base.file).read_text()
    changed = tmp_path / "go_to_xy.yaml"
    changed.write_text(text.replace("turn IS straight", "turn IS hard_left"))
    monkeypatch.setattr(BehaviorRules, "file_beside", of_folder(tmp_path))
    with pytest.raises(InputError, match="and is now") as error:
        moment_at(folder, 4.8)
    shown = str(error.value).splitlines()
    assert any(line.startswith("  go_to_xy: -") and "turn IS straight" in line for line in shown)
    assert any(line.startswith("  go_to_xy: +") and "turn IS hard_left" in line for line in shown)


def of_folder(folder: Path) -> object:
    """``BehaviorRules.file_beside``, but files in ``folder`` come first."""
    beside = BehaviorRules.file_beside

    def file_beside(module_file: str) -> Path:
        shipped = beside(module_file)
        return folder / shipped.name if (folder / shipped.name).exists() else shipped

    return staticmethod(file_beside)


def test_what_a_decision_lacks_is_not_taken_for_nothing(decisions: RecordedDecisions) -> None:
    context = decisions.contexts[30]
    assert context.percept is not None
    with pytest.raises(AttributeError):
        _ = context.flow
    with pytest.raises(AttributeError):
        _ = context.percept.sigma
    with pytest.raises(AttributeError):
        _ = context.belief.places
