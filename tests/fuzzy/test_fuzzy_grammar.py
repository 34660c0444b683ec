"""Rule sentences: how they are parsed, and the messages for malformed ones."""

from __future__ import annotations

import pytest
from fuzzy_samples import clauses
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.fuzzy import KEYWORDS, And, Clause, Is, Not, Or, ParsedRule, SentenceError, parse_rule

INPUTS = {"distance": ("near", "far"), "side": ("left", "middle", "right")}
OUTPUTS = {"turn": ("left", "right"), "speed": ("slow", "fast")}
NEAR, LEFT = Is("distance", "near"), Is("side", "left")


def parse(sentence: str) -> ParsedRule:
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
def test_errors_give_the_expected_token_and_the_column(
    sentence: str, problem: str, column: int
) -> None:
    with pytest.raises(SentenceError) as caught:
        parse(sentence)
    assert problem in caught.value.problem
    assert caught.value.column == column
    *_, quoted, marker = str(caught.value).split("\n")
    assert quoted == f"    {sentence}"
    assert marker.index("^") == 4 + column - 1
