"""The run of a mission in a test, assertions on it, and the report on it if a test fails.

::

    @pytest.mark.mission(world="office", mission="lobby-to-lab")
    def test_the_way_to_the_lab(mission):
        assert_reached(mission)
        assert_clearance(mission, 0.05)
        assert_visited(mission, "corridor-west", "lab")
        assert_behavior_led(mission, "traverse_door", 1.0)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from importlib import util
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from navfw.errors import UnknownNameError
from navfw.missions.outcome import MissionVerdict
from navfw.missions.run_metrics import RunResult
from navfw.missions.session import MissionResult
from navfw.missions.session_setup import run as run_mission
from navfw.mofis.explanation_text import explanation_lines
from navfw.numerics import Array
from navfw.recording.run_folder import PICTURE, RECORDING, RunFolder
from navfw.recording.run_observers import RunLog
from navfw.testing.mission_case import MissionCase

DECISIONS = 6
"""Number of the last changes of the leading behaviour that a report shows."""


@dataclass(frozen=True, kw_only=True)
class MissionRun(RunResult):
    """The value of the ``mission`` fixture: the result of one run, to make assertions on.

    ``stack`` is the name of the stack that drove; ``stack_named`` says whether the mission names
    one. ``faults`` are those of plugins, each with file and line, that the mission's events did not
    inject; a test fails if there are ``objections``, unless its marker says ``allow_faults=True``.
    ``behaviors`` are the names of all behaviours of the stack, ``places`` x, y [m] of the map's
    places by name. ``explanation`` is that of the last command (``Stack.explain``). ``log`` has one
    row per control tick. ``folder`` is where ``save`` writes the run folder. ``cached`` says that
    the run was taken from pytest's cache.
    """

    stack: str
    stack_named: bool
    verdict: MissionVerdict
    behaviors: tuple[str, ...]
    places: Mapping[str, tuple[float, float]]
    explanation: dict[str, Any]
    log: RunLog
    case: MissionCase
    folder: Path
    cached: bool = False
    driven: list[MissionResult] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, result: MissionResult, case: MissionCase, folder: Path) -> MissionRun:
        """Make the run of ``case`` from its ``result``, before the stack drives again."""
        session = result.session
        plain = {one.name: getattr(result, one.name) for one in fields(RunResult)}
        places = session.mission.topo_map.places.values()
        return cls(
            **{**plain, "faults": session.uninvited(result.faults)},
            stack=session.stack_file.stem,
            stack_named=session.mission.spec.stack is not None,
            verdict=result.verdict,
            behaviors=tuple(session.stack.mofis.behaviors),
            places={place.name: (place.x, place.y) for place in places},
            explanation=session.stack.explain(),
            log=result.log,
            case=case,
            folder=folder,
            driven=[result],
        )

    def __repr__(self) -> str:
        return f"<{self.title}: {self.outcome}: {self.reason}>"

    @property
    def path(self) -> Array:
        """(n, 3) true poses x, y [m], yaw [rad] in the map, one per control tick."""
        return self.log.true

    @property
    def commands(self) -> Array:
        """(n, 3) time [s], v [m/s], w [rad/s], one per control tick."""
        return self.log.command_stream

    @property
    def title(self) -> str:
        """World, mission and seed as text."""
        return f"{self.world}/{self.mission}, seed {self.seed}"

    @property
    def result(self) -> MissionResult:
        """The complete result; a run from the cache is driven again for it, with equal commands."""
        if not self.driven:
            self.driven.append(drive(self.case))
        return self.driven[0]

    def save(self) -> Path:
        """Write the run folder, with the recording, unless it exists; return its path."""
        from navfw.missions.run_report import write_run

        if not self.folder.exists():
            with RunFolder(self.folder) as target:
                write_run(self.result, target)
        return self.folder


def drive(case: MissionCase) -> MissionResult:
    """Drive the mission of ``case``; it is recorded if the extra ``record`` is installed.

    Raises:
        InputError: the mission cannot be driven.
        KeyboardInterrupt: the user has stopped the run.

    """
    return run_mission(
        case.world,
        case.mission,
        seed=case.seed,
        stack=case.stack,
        set=case.overrides,
        record=util.find_spec("foxglove") is not None,
    )


def properties(run: MissionRun) -> list[tuple[str, str]]:
    """Return names and values of the run for JUnit XML and other reports."""
    return [
        ("world", run.world),
        ("mission", run.mission),
        ("seed", str(run.seed)),
        ("stack", run.stack),
        ("outcome", str(run.outcome)),
        ("reason", run.reason),
        ("command_hash", run.command_hash),
        *(("fault", fault) for fault in run.faults),
    ]


def saved_properties(run: MissionRun) -> list[tuple[str, str]]:
    """Save the run folder; return its picture and recording as report properties, or "none"."""
    try:
        folder = run.save()
    except Exception as error:  # a missing picture must not hide the test's failure
        return [("picture", f"none, {error}"), ("recording", "none")]
    files = {"picture": folder / PICTURE, "recording": folder / RECORDING}
    return [(name, str(file) if file.exists() else "none") for name, file in files.items()]


def describe(run: MissionRun, saved: list[tuple[str, str]]) -> Iterator[str]:
    """Yield the lines of the report on a failed test."""
    verdict = run.verdict
    yield run.title
    named = "named by the mission" if run.stack_named else "neither test nor mission names one"
    yield f"stack:   {run.stack} ({'named by the test' if run.case.stack else named})"
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
    if run.explanation:
        yield "the last command:"
        yield from (f"  {line}" for line in explanation_lines(run.explanation))
    if verdict.trace:
        yield verdict.trace


def _decisions(log: RunLog) -> Iterator[str]:
    """Yield the last times at which another behaviour began to lead."""
    ticks = zip(log.time.tolist(), log.leader.tolist(), strict=True)
    spans = [(leader, list(times)) for leader, times in groupby(ticks, key=lambda tick: tick[1])]
    if spans:
        yield "the last decisions:"
    for leader, times in spans[-DECISIONS:]:
        name = log.leaders[leader] or "no behaviour"
        yield f"  {times[0][0]:6.1f} to {times[-1][0]:6.1f} s: {name} leads"


def assert_reached(mission: MissionRun) -> None:
    """Raise AssertionError unless the robot truly reached all goals."""
    __tracebackhide__ = True
    if not mission.outcome.succeeded:
        raise AssertionError(f"expected the goal to be reached; {mission.verdict}")


def assert_no_collision(mission: MissionRun) -> None:
    """Raise AssertionError if the robot touched anything but the floor, or fell into a drop."""
    __tracebackhide__ = True
    contacts = mission.log.contacts
    if contacts:
        first = contacts[0]
        where = f"{first.body} at ({first.x:.2f}, {first.y:.2f}) after {first.time:.1f} s"
        raise AssertionError(f"expected no collision; the robot touched {where}")


def assert_clearance(mission: MissionRun, at_least: float) -> None:
    """Raise AssertionError unless the body stayed ``at_least`` [m] away from everything."""
    __tracebackhide__ = True
    smallest = mission.min_clearance_m
    if not smallest >= at_least:
        what = f"expected a clearance of at least {at_least:g} m"
        raise AssertionError(f"{what}; the smallest was {smallest:.3f} m")


def assert_visited(
    mission: MissionRun, *places: str | tuple[float, float], within: float = 0.5
) -> None:
    """Raise AssertionError unless the robot truly passed all ``places``, in this order.

    It passed one within ``within`` [m]. A place is a name on the map, or a point x, y [m].

    Raises:
        UnknownNameError: the mission's map has no such place.

    """
    __tracebackhide__ = True
    map_places = mission.places
    start = 0
    for place in places:
        if isinstance(place, str) and place not in map_places:
            raise UnknownNameError("place", place, map_places)
        x, y = map_places[place] if isinstance(place, str) else place
        name = place if isinstance(place, str) else f"({x:g}, {y:g})"
        away = np.hypot(mission.path[start:, 0] - x, mission.path[start:, 1] - y)
        near = np.flatnonzero(away <= within)
        if not near.size:
            after = f" after {mission.log.time[start]:.1f} s" if start else ""
            closest = f"{away.min():.2f} m" if away.size else "unknown"
            what = f"expected the robot within {within:g} m of {name}{after}"
            raise AssertionError(f"{what}; its smallest distance was {closest}")
        start += int(near[0])


def assert_behavior_led(mission: MissionRun, behavior: str, at_least: float = 0.1) -> None:
    """Raise AssertionError unless the behaviour led for ``at_least`` [s] in total (simulated).

    Raises:
        UnknownNameError: the stack has no such behaviour.

    """
    __tracebackhide__ = True
    if behavior not in mission.behaviors:
        raise UnknownNameError("behavior", behavior, mission.behaviors)
    log = mission.log
    tick = float(np.median(np.diff(log.time))) if log.ticks > 1 else 0.0
    led = {name: tick * int((log.leader == at).sum()) for at, name in enumerate(log.leaders)}
    if led.get(behavior, 0.0) < at_least:
        others = sorted(((time, name) for name, time in led.items() if name), reverse=True)
        shown = ", ".join(f"{name} {time:.1f} s" for time, name in others)
        what = f"expected {behavior} to lead for at least {at_least:g} s"
        raise AssertionError(f"{what}, got {led.get(behavior, 0.0):.1f} s; led: {shown or 'none'}")
