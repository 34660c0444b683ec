"""What the report of a failed mission test shows, and the properties of every mission test."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from navfw.mofis.explanation import explanation_lines
from navfw.recording.run_folder import PICTURE, RECORDING
from navfw.recording.run_log import RunLog
from navfw.testing.mission_run import MissionRun

DECISIONS = 6
"""Number of last changes of the leading behaviour that a report shows."""


def properties(run: MissionRun) -> list[tuple[str, str]]:
    """Names and values for JUnit XML and other reports."""
    return [
        ("world", run.run.world),
        ("mission", run.run.mission),
        ("seed", str(run.seed)),
        ("stack", run.stack),
        ("outcome", str(run.outcome)),
        ("reason", run.reason),
        ("command_hash", run.command_hash),
        *(("fault", fault) for fault in run.faults),
    ]


def saved_properties(run: MissionRun) -> list[tuple[str, str]]:
    """Save the run folder; the paths in it for reports, or why there is none."""
    try:
        folder = run.save()
    except Exception as error:  # a missing picture must not hide the test's failure
        return [("picture", f"none, {error}"), ("recording", "none")]
    files = {"picture": folder / PICTURE, "recording": folder / RECORDING}
    return [(name, str(file) if file.exists() else "none") for name, file in files.items()]


def describe(run: MissionRun, saved: list[tuple[str, str]]) -> Iterator[str]:
    """The lines of the report on a failed test."""
    verdict = run.run.verdict
    yield run.title
    yield f"stack:   {run.stack} ({'named by the test' if run.case.stack else _whose(run)})"
    leader = verdict.behavior or "none"
    yield f"outcome: {verdict.outcome} after {verdict.time:.1f} s, leading behaviour: {leader}"
    yield f"reason:  {verdict.reason}"
    for fault in run.faults:
        yield f"fault:   {fault}"
    for name, value in saved:
        yield f"{name}: {value}"
    if run.cached:
        yield "driven earlier, taken from pytest's cache; --mission-fresh drives it again"
    yield from _decisions(run.log)
    if run.run.explanation:
        yield "the last command:"
        yield from (f"  {line}" for line in explanation_lines(run.run.explanation))
    if verdict.trace:
        yield verdict.trace


def _whose(run: MissionRun) -> str:
    return "named by the mission" if run.run.stack_named else "neither test nor mission names one"


def _decisions(log: RunLog) -> Iterator[str]:
    """The last times at which another behaviour began to lead."""
    ticks = zip(log.time.tolist(), log.leader.tolist(), strict=True)
    spans = [(leader, list(times)) for leader, times in groupby(ticks, key=lambda tick: tick[1])]
    if spans:
        yield "the last decisions:"
    for leader, times in spans[-DECISIONS:]:
        name = log.leaders[leader] or "no behaviour"
        yield f"  {times[0][0]:6.1f} to {times[-1][0]:6.1f} s: {name} leads"
