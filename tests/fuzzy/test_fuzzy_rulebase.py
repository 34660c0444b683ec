"""Rule sentences and rule base files: how they are read, and the messages for malformed ones."""

from pathlib import Path

import numpy as np
import pytest
from fuzzy_samples import clauses, rule_base_of, small
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.errors import RuleBaseError
from navfw.fuzzy import load_rule_base, parse_rule_base
from navfw.fuzzy.rulebase import (
    KEYWORDS,
    And,
    Clause,
    Is,
    Not,
    Or,
    Rule,
    SentenceError,
    atoms,
    parse_rule,
)

INPUTS = {"distance": ("near", "far"), "side": ("left", "middle", "right")}
OUTPUTS = {"turn": ("left", "right"), "speed": ("slow", "fast")}
NEAR, LEFT = Is("distance", "near"), Is("side", "left")


def parse(sentence: str) -> Rule:
    return parse_rule(sentence, INPUTS, OUTPUTS)


def test_not_binds_before_and_before_or() -> None:
    condition = "NOT distance IS near AND side IS left OR side IS right"
    expected: Clause = Or(And(Not(NEAR), LEFT), Is("side", "right"))
    assert parse(f"IF {condition} THEN turn IS left").antecedent == expected
    grouped = "NOT (distance IS near AND (side IS left OR side IS right))"
    expected = Not(And(NEAR, Or(LEFT, Is("side", "right"))))
    assert parse(f"IF {grouped} THEN turn IS left").antecedent == expected


def test_conclusions_hedges_weight_and_case() -> None:
    rule = parse(
        "if distance is NOT very very near then turn is left, speed is slow with .8 weight"
    )
    assert rule.antecedent == Not(Is("distance", "near", ("very", "very")))
    assert rule.conclusions == (("turn", "left"), ("speed", "slow"))
    assert rule.weight == 0.8
    joined = parse("IF distance IS somewhat far THEN turn IS left AND speed IS slow")
    assert joined.conclusions == rule.conclusions
    assert joined.antecedent == Is("distance", "far", ("somewhat",))
    assert joined.weight == 1.0


@settings(max_examples=100, derandomize=True)
@given(clauses([(name, term) for name, terms in INPUTS.items() for term in terms]))
def test_a_clause_as_text_reads_back_as_itself(clause: Clause) -> None:
    again = parse(f"IF {clause} THEN turn IS left").antecedent
    assert str(again) == str(clause)
    assert parse(f"IF {again} THEN turn IS left").antecedent == again


@settings(max_examples=200, derandomize=True)
@given(
    st.lists(
        st.sampled_from(
            [*sorted(KEYWORDS), *INPUTS, *OUTPUTS, "near", "left", "very", *"(),2?é", "0.5"]
        ),
        max_size=12,
    ).map(" ".join)
)
def test_any_words_parse_or_raise_an_error_with_a_column(sentence: str) -> None:
    try:
        rule = parse(sentence)
    except SentenceError as error:
        assert 1 <= error.column <= len(sentence) + 1
        assert "expected" in error.problem
    else:
        assert rule.conclusions


@pytest.mark.parametrize(
    ("sentence", "problem", "column"),
    [
        ("distance IS near THEN turn IS left", "expected IF, got 'distance'", 1),
        ("IFF distance IS near THEN turn IS left", "expected IF, got 'IFF'; did you mean 'IF'?", 1),
        ("", "expected IF, got the end of the sentence", 1),
        ("IF distanc IS near THEN turn IS left", "did you mean 'distance'?", 4),
        ("IF turn IS left THEN turn IS left", "'turn': it is used after THEN", 4),
        ("IF distance near THEN turn IS left", "expected IS after 'distance', got 'near'", 13),
        ("IF distance IS nera THEN turn IS left", "'nera': did you mean 'near'?", 16),
        ("IF distance IS vry near THEN turn IS left", "did you mean 'very'?", 16),
        ("IF distance IS THEN turn IS left", "expected a term of 'distance' (near, far)", 16),
        ("IF distance IS near side IS left THEN turn IS left", "AND, OR or THEN, got 'side'", 21),
        ("IF (distance IS near THEN turn IS left", "the ')' of the '(' in column 4", 22),
        ("IF distance IS near) THEN turn IS left", "')' without its '('", 20),
        ("IF distance IS near THEN", "expected an output, got the end", 25),
        ("IF distance IS near THEN side IS left", "'side': it is used after IF", 26),
        ("IF distance IS near THEN turn IS very left", "conclusions take no hedge", 34),
        ("IF distance IS near THEN turn IS left, turn IS right", "each output once", 40),
        ("IF distance IS near THEN turn IS left WITH 1.5", "a weight above 0 and at most 1", 44),
        ("IF distance IS near THEN turn IS left WITH much", "a weight above 0", 44),
        ("IF distance IS near THEN turn IS left speed", "expected ',', WITH or the end", 39),
        ("IF distance IS near ? THEN turn IS left", "got '?'", 21),
        ("IF " + "NOT " * 60 + "distance IS near THEN turn IS left", "at most 50 levels", 204),
    ],
)
def test_errors_give_expected_token_and_column(sentence: str, problem: str, column: int) -> None:
    with pytest.raises(SentenceError) as caught:
        parse(sentence)
    assert problem in caught.value.problem
    assert caught.value.column == column
    *_, quoted, marker = str(caught.value).split("\n")
    assert quoted == f"    {sentence}"
    assert marker.index("^") == 4 + column - 1


TEXT = """\
name: turn
description: away from what is near
inputs:
  distance:
    range: [0, 2]
    unit: m
    terms:
      near: {trapezoid: [0, 0, .5, 1]}
      far: {trapezoid: [.5, 1, 2, 2]}
outputs:
  turn:
    range: [-1, 1]
    terms:
      none: {triangle: [-1, 0, 1]}
      left: {gauss: [1, .2]}
rules:
  - IF distance IS near THEN turn IS left
  - IF distance IS far
    THEN turn IS none WITH 0.5 weight
"""


def error_of(text: str) -> RuleBaseError:
    with pytest.raises(RuleBaseError) as caught:
        parse_rule_base(text, "turn.yaml")
    return caught.value


def test_a_file_or_mapping_becomes_variables_and_rules(tmp_path: Path) -> None:
    path = tmp_path / "turn.yaml"
    path.write_text(TEXT, encoding="utf-8")
    rule_base = load_rule_base(path)
    assert rule_base.name == "turn"
    assert rule_base.file is not None
    distance = rule_base.inputs["distance"]
    assert (distance.low, distance.high, distance.unit) == (0.0, 2.0, "m")
    assert list(distance.terms) == ["near", "far"]
    assert rule_base.conjunction == "min"
    first, second = rule_base.rules
    assert first.sentence == "IF distance IS near THEN turn IS left"
    assert (first.weight, first.line) == (1.0, 17)
    assert (second.weight, second.line) == (0.5, 18)
    assert second.sentence == "IF distance IS far THEN turn IS none WITH 0.5 weight"
    assert rule_base == parse_rule_base(TEXT)
    assert not distance.universe.flags.writeable
    assert list(rule_base_of(small()).inputs) == ["distance", "side"]


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("name: turn", "nam: turn", 1, "did you mean 'name'?"),
        ("range: [0, 2]", "range: [2, 0]", 5, "[low, high] with high > low, got [2, 0]"),
        ("range: [0, 2]", "range: [0, .inf]", 5, "range"),
        ("range: [0, 2]", "range: [0, 2, 3]", 5, "range"),
        ("unit: m", "units: m", 6, "did you mean 'unit'?"),
        ("{gauss: [1, .2]}", "{gaus: [1, .2]}", 15, "unknown shape 'gaus': did you mean 'gauss'?"),
        ("{gauss: [1, .2]}", "{gauss: [1, .2, 3]}", 15, "expected 2 numbers [mean, sigma], got 3"),
        ("{gauss: [1, .2]}", "{gauss: [1, .2], triangle: [0, 1, 1]}", 15, "one shape"),
        ("{gauss: [1, .2]}", "{}", 15, "expected one shape"),
        ("{gauss: [1, .2]}", "{triangle: [5, 6, 7]}", 15, "it is 0 all over it"),
        ("{triangle: [-1, 0, 1]}", "{triangle: [0, -1, 1]}", 14, "a <= b <= c"),
        ("near: {", "very: {", 8, "'very', which is a keyword or hedge"),
        ("near: {", "so-near: {", 8, "letters, digits and '_', got 'so-near'"),
        ("  turn:", "  distance:", 11, "a name that no input has"),
        ("distance IS near", "distance IS neer", 17, "'neer': did you mean 'near'?"),
        ("distance IS near", "distans IS near", 17, "'distans': did you mean 'distance'?"),
        ("IS far\n", "far\n", 18, "expected IS after 'distance', got 'far' (column 13)"),
        ("    unit: m", "    unit: [m", 7, "not valid YAML"),
        ("[-1, 1]", "[-1, 1]\n    default: 3", 13, "outputs.turn.default: expected a value within"),
    ],
)
def test_errors_name_file_line_and_remedy(old: str, new: str, line: int, message: str) -> None:
    assert TEXT.count(old) == 1
    error = error_of(TEXT.replace(old, new))
    assert message in str(error)
    assert str(error).startswith("turn.yaml:")
    assert f"turn.yaml:{line}: " in str(error)


@pytest.mark.parametrize("default", [-1.0, 1.0])
def test_a_default_may_be_an_end_of_the_range(default: float) -> None:
    text = TEXT.replace("[-1, 1]", f"[-1, 1]\n    default: {default}")
    assert parse_rule_base(text).outputs["turn"].default == default


def test_between_its_samples_a_gaussian_is_almost_exact() -> None:
    turn = parse_rule_base(TEXT.replace("[1, .2]", "[.3, .02]")).outputs["turn"]
    x = np.linspace(-1.0, 1.0, 4001)
    degrees = np.interp(x, turn.universe, turn.sampled("left"))
    # lines between points a quarter sigma apart are off by (1/4)^2 / 8 of the second derivative
    assert np.abs(degrees - np.exp(-0.5 * ((x - 0.3) / 0.02) ** 2)).max() < 0.008


def test_a_sentence_is_shown_with_a_marker() -> None:
    error = error_of(TEXT.replace("distance IS near", "distance IS neer"))
    assert error.key == "rules[0]"
    assert str(error).splitlines()[1:] == [
        "    IF distance IS neer THEN turn IS left",
        "                   ^",
    ]


def test_one_error_lists_all_malformed_sentences() -> None:
    error = error_of(TEXT.replace("IS near", "IS neer").replace("turn IS none", "turn IS non"))
    assert "turn.yaml:17: rules[0]" in str(error)
    assert "turn.yaml:18: rules[1]" in str(error)


def test_what_no_rule_uses_is_an_error() -> None:
    idle = "  side:\n    range: [0, 1]\n    terms: {left: {triangle: [0, 0, 1]}}\n"
    for key, part in (("inputs:\n", "IF"), ("outputs:\n", "THEN")):
        assert f"'side' in its {part} part" in str(error_of(TEXT.replace(key, key + idle)))


def test_a_file_that_was_changed_is_read_again_and_a_missing_one_refused(tmp_path: Path) -> None:
    path = tmp_path / "rules.yaml"
    path.write_text(TEXT)
    first = load_rule_base(path)
    assert load_rule_base(path) is first  # every stack of a process shares it
    path.write_text(TEXT.replace("name: ", "name: other_", 1))
    assert load_rule_base(path).name == f"other_{first.name}"
    with pytest.raises(RuleBaseError, match="no such file"):
        load_rule_base(tmp_path / "none.yaml")


def test_literals_come_with_the_number_of_nots_around_them() -> None:
    a, b = Is("x", "low"), Is("y", "high")
    assert list(atoms(And(Not(Not(a)), Not(Or(b, Not(a)))))) == [(a, 2), (b, 1), (a, 2)]
