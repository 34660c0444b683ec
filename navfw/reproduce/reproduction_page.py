"""The page of ``navfw reproduce``, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from navfw.offis.pyramid import position
from navfw.reproduce.paper_tables import FAST, PERIOD, SceneRow, WaypointRow
from navfw.reproduce.rendered_views import CheckedPercept, RenderedPair

__all__ = ["PAPER_TIMES", "write_page"]

PAPER_TIMES = {"obstacles_s": 0.16, "situation_synthetic_s": 0.58, "situation_real_s": 0.62}
"""Times of OFFIS [s] in the paper, on an Athlon XP 2600+ at 2.09 GHz."""

_INTRODUCTION = """\
# The paper's experiments, repeated

N. A. Mai, K. Janschek: *Bio-inspired Optical Flow Interpretation with Fuzzy Logic for
Behavior-Based Robot Control*, RAAD 2009. This page was written by `navfw reproduce --seed {seed}`;
the same seed gives the same images, percepts and tables (only the times vary).

Percepts are checked against the geometry of the world: the quadrants named for the nearest object
must contain it, its distance term must be that of the true distance, and the situation in front
must be one that the walls form. Where the walls form none of Table 1's situations, or furniture
hides them, the situation is not checked, as the line "Truth" notes.

OFFIS runs in two modes. *Normalised* is navfw's default: nearness instead of raw flow, floor
removed. *Raw means* follows the paper literally: means of the flow's components.
"""

_DIFFERENCES = """\
## What differs from the paper

- Figs. 11, 13, 15 (membership functions), Fig. 16 (room and trajectory) and the body of Table 2
  are not in the available text. Rule bases, room and trajectory are navfw's own; only their
  structure follows the text. The wording of the paper's false conclusion at waypoint 3 is unknown.
- The images are rendered by a software renderer, not by POV-Ray; the "real" images of Table 3 are
  rendered as well.
- Without derotation the raw means lead to a false conclusion with high confidence, as the paper
  reports. The normalised mode detects that the flow is inconsistent with the motion and mostly
  infers "unknown": wrong, but not a false conclusion.
- With the rotation removed, the raw means often name lower quadrants, where the flow of the floor
  is largest. The paper's rules for that case are not given; the normalised mode removes the floor
  and reports it as "Floor in front".
- In raw means the position in the image looks like slope (a frontal wall flows three times as fast
  in its outer half); the slope rules of that mode are centred on this pattern.
- Upper and lower quadrants follow the usual numbering of quadrants, since Fig. 4 is missing.
- Table 3: 10 x 15 cells do not divide 108 x 144 pixels; the grid covers the central 100 x 135. The
  camera (55 cm high, 65 degrees wide) and all distances are assumed.
- Table 3 prints "Floor in front" for situations 1 and 2. With block matching it is missing where
  the windows on the near floor, whose flow changes most from row to row, find no match.
- The paper times obstacles and situation separately; here one inference gives both.
"""


def write_page(
    seed: int,
    rows: Sequence[WaypointRow],
    scenes: Sequence[SceneRow],
    metrics: Mapping[str, Any],
    timings: Mapping[str, float],
    checks: Mapping[str, bool],
) -> str:
    """The whole page; its pictures are ``map.png``, ``waypoint-N.png`` and ``scene-N.png``."""
    parts = [
        _INTRODUCTION.format(seed=seed),
        *_summary(rows, checks),
        *_table2(rows),
        *_table3(scenes),
        *_metrics(metrics),
        *_timings(timings),
        _DIFFERENCES,
    ]
    return "\n".join(parts)


def _summary(rows: Sequence[WaypointRow], checks: Mapping[str, bool]) -> Iterator[str]:
    yield "## Summary\n"
    yield "| check | |"
    yield "|---|---|"
    for name, good in checks.items():
        yield f"| {name} | {'yes' if good else '**no**'} |"
    for kind in ("ideal", "block matching"):
        for mode in ("normalised", "raw means"):
            right = {
                rotation: sum(row.percepts[kind, rotation, mode].right for row in rows)
                for rotation in ("removed", "left in")
            }
            yield (
                f"| waypoints with correct percepts, {kind} flow, {mode} |"
                f" {right['removed']} of {len(rows)} with derotation, {right['left in']} without |"
            )
    yield ""


def _table2(rows: Sequence[WaypointRow]) -> Iterator[str]:
    yield "## Table 2: waypoints of the simulated trajectory\n"
    yield (
        "Images 120 x 160, 12 x 16 vectors, two layers. The behaviour is go-to-XY; at waypoint"
        f" {FAST} the robot turns left at 0.9 rad/s. The images of a pair are"
        f" {PERIOD:g} s apart. Block matching searches 16 px, so that the fast turn stays within"
        " the search range even without the gyro.\n"
    )
    yield "![the room from above](map.png)\n"
    for row in rows:
        number, twist = row.waypoint.number, row.point.twist
        yield (
            f"### Waypoint {number}: the robot {row.waypoint.doing}"
            f" ({twist.v:.2f} m/s, {twist.w:+.2f} rad/s)\n"
        )
        yield f"![waypoint {number}](waypoint-{number}.png)\n"
        yield f"Truth: {_truth(row.view)}\n"
        yield "| flow | rotation | mode | OFFIS | |"
        yield "|---|---|---|---|---|"
        for (kind, rotation, mode), checked in row.percepts.items():
            sentence = checked.percept.sentence
            yield f"| {kind} | {rotation} | {mode} | {sentence} | {_verdict(checked)} |"
        yield ""


def _table3(scenes: Sequence[SceneRow]) -> Iterator[str]:
    yield "## Table 3: three situations in an office\n"
    yield (
        "Images 108 x 144, 10 x 15 vectors, windows of 24 x 24 px, the camera strictly forward."
        " The first row of each table is what the paper printed for its own office.\n"
    )
    for row in scenes:
        number = row.scene.number
        yield f"### Situation {number}: {row.scene.title}\n"
        yield f"![situation {number}](scene-{number}.png)\n"
        yield f"Truth: {_truth(row.view)}\n"
        yield "| | OFFIS | |"
        yield "|---|---|---|"
        yield f"| the paper | {row.scene.paper} | |"
        for (kind, mode), checked in row.percepts.items():
            yield f"| {kind}, {mode} | {checked.percept.sentence} | {_verdict(checked)} |"
        yield ""


def _metrics(metrics: Mapping[str, Any]) -> Iterator[str]:
    yield "## Section 4.3: two layers of means, or one layer of means and variances?\n"
    yield (
        f"{metrics['views']} generated views ({metrics['clear']} of them with a clear situation)."
        " First OFFIS with either metric: it infers the situation from the planes, so a metric"
        " only changes which region counts as nearest. The paper's claim, that two layers of"
        " means are at least as good, concerns the first two rows.\n"
    )
    kinds = ("ideal", "block matching")
    yield (
        "| OFFIS with | "
        + " | ".join(
            f"{what}, {kind}" for kind in kinds for what in ("quadrant", "distance", "situation")
        )
        + " |"
    )
    yield "|---" * 7 + "|"
    for name, found in metrics["offis"].items():
        shares = [
            found[kind][what] for kind in kinds for what in ("quadrant", "distance", "situation")
        ]
        yield f"| {name} | " + " | ".join(map(_percent, shares)) + " |"
    yield ""
    yield (
        "Then the metrics alone: a linear discriminant infers nearest quadrant and elementary"
        " situation from the means (and standard deviations) of |u| and |v| in the regions, on"
        " views that it was not trained on.\n"
    )
    yield (
        "| metrics | "
        + " | ".join(f"{what}, {kind}" for kind in kinds for what in ("quadrant", "situation"))
        + " |"
    )
    yield "|---" * 5 + "|"
    for name, found in metrics["numbers"].items():
        shares = [found[kind][what] for kind in kinds for what in ("quadrant", "situation")]
        yield f"| {name} | " + " | ".join(map(_percent, shares)) + " |"
    yield ""
    yield _verdict_on_metrics(metrics["numbers"])


def _verdict_on_metrics(found: Mapping[str, Any]) -> str:
    """Whether the classifier's results agree with the paper's claim, as a sentence."""
    means, both = found["L=2, means"], found["L=1, means and variances"]
    held: list[str] = []
    missed: list[str] = []
    for kind in means:
        for what, share in means[kind].items():
            if share is None or both[kind][what] is None:
                continue
            text = f"{what}, {kind} ({_percent(share)} against {_percent(both[kind][what])})"
            (held if share >= both[kind][what] else missed).append(text)
    parts = [
        f"Two layers of means are at least as good for: {'; '.join(held)}." if held else "",
        f"They are worse for: {'; '.join(missed)}." if missed else "",
    ]
    return " ".join(part for part in parts if part) + "\n"


def _timings(timings: Mapping[str, float]) -> Iterator[str]:
    obstacles, synthetic, real = (1e3 * PAPER_TIMES[key] for key in PAPER_TIMES)
    yield "## Times\n"
    yield "| | paper (Athlon XP 2600+) | here (median, one thread) | ratio |"
    yield "|---|---|---|---|"
    for name, paper, key in (
        ("obstacles and situation, 12 x 16", obstacles + synthetic, "offis_12x16_ms"),
        ("obstacles and situation, 10 x 15", obstacles + real, "offis_10x15_ms"),
    ):
        parts = f"160 + {paper - obstacles:.0f} ms"
        yield f"| {name} | {parts} | {timings[key]:.2f} ms | {paper / timings[key]:.0f} |"
    yield (
        "| block matching, 12 x 16, 24 px, +-8 px | - |"
        f" {timings['block_matching_12x16_ms']:.2f} ms | - |"
    )
    yield ""


def _truth(view: RenderedPair) -> str:
    truth = view.truth
    where = " and ".join(position(name) for name in sorted(truth.certain))
    front = {
        "mixed": "in front none of Table 1's situations",
        "hidden": "furniture hides what the walls make in front",
    }.get(truth.situations[0], "in front " + " and ".join(truth.situations))
    return f"nearest {where}, {truth.distance:.2f} m ({truth.term}); {front}."


def _verdict(checked: CheckedPercept) -> str:
    if checked.right:
        return "correct"
    wrong = [
        name
        for name, good in (
            ("quadrant", checked.quadrant),
            ("distance", checked.distance),
            ("front", checked.situation is not False),
        )
        if not good
    ]
    return f"**wrong**: {', '.join(wrong)}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.0f} %"
