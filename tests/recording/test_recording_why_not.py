"""Why not: the decision is made again, and the changes that are told do turn it."""

import json
import shutil
from pathlib import Path
from unittest.mock import Mock

import pytest
from cli_calls import invoke, refusal

from navfw.errors import InputError
from navfw.recording.decision_moment import DecisionMoment
from navfw.recording.explanations import explain_at
from navfw.recording.recorded_decisions import moment_at
from navfw.recording.smallest_change import _least
from navfw.recording.why_not import (
    DIRECTIONS,
    WhyNot,
    _predicate,
    why_not,
    why_not_lines,
)

TIMES = (1.5, 2.4, 3.3, 4.8, 5.6)


@pytest.fixture(scope="module")
def moments(folder: Path) -> dict[float, DecisionMoment]:
    return {time: moment_at(folder, time) for time in TIMES}


def answers(moment: DecisionMoment) -> list[tuple[str, WhyNot]]:
    """The answers of all directions that were not commanded."""
    found = []
    for wanted in DIRECTIONS:
        try:
            found.append((wanted, why_not(moment, wanted)))
        except InputError as error:
            assert "was that" in str(error) or "has no command like that" in str(error)
    return found


@pytest.mark.parametrize("time", TIMES)
def test_the_decision_is_made_again_as_it_was(
    folder: Path, moments: dict[float, DecisionMoment], time: float
) -> None:
    recorded, (command, proposals) = explain_at(folder, time), moments[time].decide()
    twist = command.twist.v, command.twist.w
    assert twist == pytest.approx((recorded["v"], recorded["w"]), abs=1e-5)
    assert command.leader == recorded["leader"]
    assert set(proposals) == set(recorded["behaviors"])
    again, _ = moments[time].decide()
    assert again.twist == command.twist


@pytest.mark.parametrize("time", TIMES)
def test_each_change_turns_the_decision_and_half_of_it_does_not(
    moments: dict[float, DecisionMoment], time: float
) -> None:
    moment = moments[time]
    given = moment.decide()[0].twist
    told = answers(moment)
    assert len(told) >= 3
    for wanted, answer in told:
        turned = _predicate(wanted, given, moment)
        assert answer.changes or answer.pair or "no change" in why_not_lines(answer)[-1]
        for change in answer.changes:
            assert turned(moment.decide([change.shift])[0].twist), (wanted, change)
            assert not turned(moment.decide([change.shift.scaled(0.5)])[0].twist), (wanted, change)
        if answer.pair:
            both = [change.shift for change in answer.pair]
            assert turned(moment.decide(both)[0].twist), (wanted, answer.pair)
        sizes = [change.size for change in answer.changes]
        assert sizes == sorted(sizes)


def test_who_was_against_it_is_told_with_rules(moments: dict[float, DecisionMoment]) -> None:
    answer = why_not(moments[4.8], "stop")
    assert answer.ratings[1] < answer.ratings[0] <= 1.0
    assert answer.against[0].loss > 0.05
    assert answer.against[0].rules[0].startswith("IF ")
    assert abs(answer.wanted[0]) < 0.03


def test_what_cannot_be_asked_is_refused(moments: dict[float, DecisionMoment]) -> None:
    for wanted, said in (("up", "expected left, right"), ("9,0", "at most 1.2 rad/s; got 9,0")):
        with pytest.raises(InputError, match=said):
            why_not(moments[4.8], wanted)
    given = moments[4.8].decide()[0].twist
    with pytest.raises(InputError, match="the command was that"):
        why_not(moments[4.8], f"{given.v:.3f},{given.w:.3f}")


def test_a_behaviour_that_fails_makes_no_proposal_as_in_the_drive(
    moments: dict[float, DecisionMoment], monkeypatch: pytest.MonkeyPatch
) -> None:
    moment = moments[4.8]
    failing = Mock(side_effect=KeyError("door 7"))
    monkeypatch.setattr(type(moment.behaviors["peek"]), "propose", failing)
    again = DecisionMoment(moment.mofis, moment.context, moment.behaviors, moment.composite)
    assert moment.decide()[1].keys() - again.decide()[1].keys() == {"peek"}
    assert why_not(again, "stop").against


def test_the_command_prints_text_or_one_object(folder: Path) -> None:
    printed = invoke("explain", folder, "--at", 4.8, "--why-not", "stop").stdout
    assert printed.startswith("at 4.")
    assert " was against it: " in printed
    data = json.loads(invoke("explain", folder, "--at", 4.8, "--why-not", "stop", "--json").stdout)
    assert set(data) >= {"commanded", "wanted", "ratings", "against", "changes", "pair"}
    assert "needs --at" in refusal("explain", folder, "--why-not", "stop")
    for time in (99, "inf", "nan"):
        said = refusal("explain", folder, "--at", time, "--why-not", "left")
        assert f"no command was in force at {time} s" in said
    both = refusal("explain", folder, "--at", 4.8, "--why-not", "stop", "--json", "--inference")
    assert "without --why-not" in both


def test_the_least_amount_is_found_also_where_more_does_not_suffice() -> None:
    assert _least(lambda a: a >= 0.3, [0.1, 0.2, 0.4, 0.8]) == pytest.approx(0.3, abs=0.01)
    assert _least(lambda a: 0.3 <= a < 0.35, [0.1, 0.2, 0.33, 0.8]) == pytest.approx(0.3, abs=0.01)
    assert _least(lambda a: a > 1.0, [0.1, 1.0]) is None
    assert _least(lambda f: f <= 0.4, [0.9, 0.5, 0.25], 1.0) == pytest.approx(0.4, abs=0.01)


def test_a_stack_that_decides_otherwise_now_is_refused(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    text = (copy / "stack.yaml").read_text()
    assert '"spare": 0.06' in text
    (copy / "stack.yaml").write_text(text.replace('"spare": 0.06', '"spare": 0.5'))
    with pytest.raises(InputError, match=r"and is now .* rules changed since"):
        moment_at(copy, 4.8)
