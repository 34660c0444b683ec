"""What if: a changed stack on recorded readings; where and why its commands are others."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from cli_calls import invoke, refusal

from navfw.errors import ConfigError, InputError, UnknownNameError
from navfw.mofis.explanation_text import rule_changes
from navfw.numerics.arrays import spans
from navfw.recording.what_if import _apart, what_if, what_if_lines

RULES = Path(__file__).parents[2] / "behaviors"


def test_the_same_stack_gives_the_same_commands(folder: Path) -> None:
    same = what_if(folder, ["avoid.spare=0.06"])
    assert (same.first, same.share, same.apart, same.differences) == (None, 0.0, None, ())
    assert what_if_lines(same) == ["the same commands in all 6.0 s"]
    assert what_if(folder, rules=[RULES / "avoid.yaml"]).first is None


def test_a_shyer_robot_is_told_by_time_behaviour_and_rule(folder: Path) -> None:
    changed = what_if(folder, ["avoid.spare=0.6"])
    assert changed.first is not None
    assert 0.5 < changed.first < 2.0
    assert changed.differences[0].time == changed.first
    assert changed.differences[0].why.startswith("avoid")
    assert changed.reasons[0][0].startswith("avoid")
    assert sum(share for _, share in changed.reasons) == pytest.approx(1.0)
    assert changed.apart is not None
    assert changed.apart > changed.first
    assert np.abs(changed.twists[:, 0]).max() <= 0.5  # wheels that go another way are no fault
    text = "\n".join(what_if_lines(changed))
    assert f"from {changed.apart:.1f} s on the paths would be more than" in text


def test_other_rules_are_those_of_the_file(folder: Path, tmp_path: Path) -> None:
    text = (RULES / "go_to_xy.yaml").read_text()
    other = tmp_path / "mine.yaml"
    other.write_text(text.replace("turn IS hard_right", "turn IS right"))
    assert "turn IS hard_right" in text
    assert what_if(folder, rules=[other]).duration == pytest.approx(6.0, abs=0.1)
    other.write_text(text.replace("name: go_to_xy", "name: go_to_x"))
    with pytest.raises(UnknownNameError, match="did you mean 'go_to_xy'"):
        what_if(folder, rules=[other])
    wrong = (RULES / "avoid.yaml").read_text().replace("name: avoid", "name: go_to_xy")
    other.write_text(wrong)
    with pytest.raises(InputError, match="inputs: expected bearing"):
        what_if(folder, rules=[other])


def test_a_wrong_change_is_refused(folder: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean 'spare'"):
        what_if(folder, ["avoid.spair=0.1"])
    assert "unknown key" in refusal("replay", folder, "--set", "avoid.spair=0.1")


def test_the_command_prints_text_or_one_object(folder: Path) -> None:
    printed = invoke("replay", folder, "--set", "avoid.spare=0.3").stdout
    assert printed.startswith("first other command at ")
    data = json.loads(invoke("replay", folder, "--set", "avoid.spare=0.3", "--json").stdout)
    expected = json.loads(json.dumps(what_if(folder, ["avoid.spare=0.3"]).as_data()))
    assert data == expected


def test_the_report_has_both_commands(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    said = invoke("replay", copy, "--set", "avoid.spare=0.6", "--report").stdout
    assert said.splitlines()[-1] == f"report: {copy / 'report.html'}"
    page = (copy / "report.html").read_text()
    assert "What if avoid.spare=0.6" in page
    data = page.split('<script type="application/json" id="data">')[1].split("</script>")[0]
    rows = json.loads(data)["rows"]
    assert len(rows["if_v"]) == len(rows["v"])
    assert sum(rows["if_v"]) < sum(rows["v"]) - 1.0
    assert "needs --set" in refusal("replay", copy, "--report")


def test_paths_are_apart_when_their_distance_exceeds_the_radius() -> None:
    times = np.arange(0.0, 10.0, 0.1)
    still, ahead = np.zeros((100, 2)), np.tile([0.5, 0.0], (100, 1))
    assert _apart(times, still, ahead, 0.2) == pytest.approx(0.5, abs=0.11)
    assert _apart(times, ahead, ahead, 0.2) is None
    turning = np.tile([0.5, 0.5], (100, 1))
    apart = _apart(times, ahead, turning, 0.2)
    assert apart is not None
    assert 1.0 < apart < 2.0


def test_short_pauses_do_not_end_a_difference() -> None:
    times = np.arange(0.0, 3.0, 0.1)
    flags = (times < 0.5) | ((times > 0.7) & (times < 1.0)) | (times > 2.0)
    assert list(spans(times, flags, 0.5)) == [(0, 9), (21, 29)]
    assert list(spans(times, np.zeros(30, np.bool_), 0.5)) == []


def test_the_reason_is_what_has_changed_most_and_asks_for_something() -> None:
    def said(strength: float, weight: float) -> dict[str, object]:
        rules = [
            {"rule": "IF a IS b THEN prohibit IS yes", "strength": strength},
            {"rule": "IF a IS c THEN prohibit IS no", "strength": 1.0 - strength},
        ]
        return {"behaviors": {"avoid": {"weight": weight, "rules": rules}}}

    assert str(rule_changes(said(0.1, 0.5), said(0.9, 0.6))[0]) == (
        "avoid: IF a IS b THEN prohibit IS yes (0.10 -> 0.90)"
    )
    assert str(rule_changes(said(0.1, 0.0), said(0.1, 0.6))[0]) == "avoid: weight (0.00 -> 0.60)"
    assert not rule_changes(said(0.1, 0.5), said(0.1, 0.5))
