"""The summary in plain words: its figures are those of the results."""

from __future__ import annotations

from typing import Any

from navfw.reproduce import summary


def claim(what: str, two: int, one: int, differ: int, p: float) -> dict[str, Any]:
    return {
        "by": "the metrics alone",
        "flow": "ideal",
        "what": what,
        "views": 50,
        "two_layers_right": two,
        "one_layer_right": one,
        "differ": differ,
        "p": p,
        "confirmed": two >= one,
    }


def reading(verdict: str, rotation: str) -> dict[str, str]:
    return {"flow": "ideal", "mode": "normalised", "rotation": rotation, "verdict": verdict}


def place(number: int, removed: str, left: str, why: str | None) -> dict[str, Any]:
    readings = [reading(removed, "removed"), reading(left, "left in")]
    return {"waypoint": number, "truth": {"no_situation": why}, "readings": readings}


def summarised(**changed: Any) -> dict[str, list[str]]:
    claims = [
        claim("quadrant", 40, 48, 10, 0.022),
        claim("situation", 30, 29, 9, 1.0),
        claim("distance", 44, 44, 0, 1.0),
        claim("quadrant", 40, 41, 3, 1.0),
    ]
    result = {
        "table2": [
            place(3, "right", "wrong", None),
            place(2, "partly", "right", "furniture hides 50% of the walls in the left half"),
        ],
        "table3": [],
        "real": None,
        "metrics": {"claims": claims},
    }
    return summary({**result, **changed})


def test_the_claim_of_section_4_3_is_told_with_its_figures() -> None:
    whole, *missed = summarised()["Section 4.3"]
    assert "is confirmed in 2 of 4 comparisons: better by more than chance (p < 0.05) in 0" in whole
    assert "alike on every view in 1. It is not confirmed in 2: worse by more than chance in 1" in (
        whole
    )
    assert missed == [
        "Not confirmed: nearest quadrant by the metrics alone, ideal flow: 40 against 48 of 50"
        " right (answers that differ: 10, p = 0.022).",
        "Not confirmed: nearest quadrant by the metrics alone, ideal flow: 40 against 41 of 50"
        " right (answers that differ: 3, p = 1).",
    ]


def test_a_claim_that_holds_everywhere_is_confirmed_everywhere() -> None:
    held = {"claims": [claim("quadrant", 48, 40, 10, 0.02)]}
    (whole,) = summarised(metrics=held)["Section 4.3"]
    assert "is confirmed in 1 of 1 comparisons: better by more than chance (p < 0.05) in 1" in whole
    assert "not confirmed in 0" in whole


def test_places_are_counted_by_verdict() -> None:
    found = summarised()["Table 2"]
    assert found[0] == "All 2 places are judged."
    assert (
        "Ideal flow, normalised: 1 right, 1 partly with the rotation removed;"
        " 1 right, 1 wrong with the rotation left in." in found
    )
    assert (
        "Waypoint 3, where the paper's conclusion is false, normalised: ideal flow, rotation"
        " removed: right; ideal flow, rotation left in: wrong." in found
    )
    assert "At 1 places (waypoints 2) the geometry forms none" in found[-1]


def test_photographs_are_counted_or_said_to_be_missing() -> None:
    assert "no recordings were given (--data DIR)" in summarised()["Table 3, photographs"][0]
    total = {"right": 3, "partly": 2, "wrong": 1, "silent": 0}
    single = {"single": True, "verdicts": {"right": 0, "silent": 7}}
    real = {"total": total, "recordings": [{"single": False}, {"single": False}, single]}
    assert summarised(real=real)["Table 3, photographs"] == [
        "6 labelled frames of 2 recordings: 3 right, 2 partly, 1 wrong.",
        "7 single photographs, about which nothing should be said: 7 silent.",
    ]
