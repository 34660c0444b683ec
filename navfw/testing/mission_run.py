"""The run of a mission in a test: its result as plain data, which may come from the cache."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from navfw.missions.event_clock import EventRecord
from navfw.missions.outcome import MissionVerdict, Outcome
from navfw.missions.run_metrics import RunMetrics
from navfw.missions.session import MissionResult, Session
from navfw.missions.session_setup import prepare
from navfw.recording.run_log import RunLog
from navfw.signals import Array
from navfw.testing.mission_case import MissionCase


@dataclass(frozen=True)
class DrivenRun:
    """What a test may ask of a run, as plain data.

    ``stack`` is the name of the stack that drove; ``stack_named`` tells whether the mission names
    one. ``faults`` are those of plugins that the mission's
    events did not inject, ``behaviors`` the names of all behaviours of the stack, ``places`` x, y
    [m] of the map's places by name. ``explanation`` is that of the last command
    (``Stack.explain``).
    """

    world: str
    mission: str
    stack: str
    stack_named: bool
    verdict: MissionVerdict
    metrics: RunMetrics
    faults: tuple[str, ...]
    events: tuple[EventRecord, ...]
    behaviors: tuple[str, ...]
    places: Mapping[str, tuple[float, float]]
    explanation: dict[str, Any]
    log: RunLog

    @classmethod
    def of(cls, result: MissionResult) -> DrivenRun:
        """The data of a result, right after the run."""
        session = result.session
        places = session.mission.topo_map.places.values()
        return cls(
            world=session.world_name,
            mission=session.mission_name,
            stack=session.stack_file.stem,
            stack_named=session.mission.spec.stack is not None,
            verdict=result.run.verdict,
            metrics=result.metrics,
            faults=tuple(result.uninvited_faults),
            events=result.run.events,
            behaviors=tuple(session.stack.mofis.behaviors),
            places={place.name: (place.x, place.y) for place in places},
            explanation=session.stack.explain(),
            log=result.run.log,
        )


def drive(case: MissionCase) -> MissionResult:
    """Drive the mission of ``case``, with a recording of its sensor readings.

    Raises:
        InputError: the mission cannot be driven.
        KeyboardInterrupt: the user has stopped the run.

    """
    result = _prepared(case).run(record=True)
    if result.outcome == "cancelled":  # caught by the runner; pytest has to stop as well
        raise KeyboardInterrupt
    return result


def _prepared(case: MissionCase) -> Session:
    return prepare(
        case.world, case.mission, seed=case.seed, stack=case.stack, overrides=case.overrides
    )


class KeptRunFolders(Protocol):
    """The run folders of runs in the cache (``navfw.testing.mission_cache.MissionCache``)."""

    def run_folder(self, case: MissionCase) -> Path | None:
        """The stored run folder of ``case``; None if there is none."""
        ...

    def keep_run_folder(self, case: MissionCase, folder: Path) -> None:
        """Store a copy of a run folder with the run of ``case``."""
        ...


@dataclass
class MissionRun:
    """The value of the ``mission`` fixture: the run of one mission.

    ``folder`` is where ``save`` writes its run folder. ``cached`` tells that this run was driven
    earlier, and is taken from pytest's cache.
    """

    case: MissionCase
    run: DrivenRun
    folder: Path
    cached: bool = False
    cache: KeptRunFolders | None = None
    driven: list[MissionResult] = field(default_factory=list, repr=False)

    def __repr__(self) -> str:
        return f"<{self.title}: {self.outcome}: {self.reason}>"

    @property
    def title(self) -> str:
        """World, mission and seed."""
        return f"{self.run.world}/{self.run.mission}, seed {self.seed}"

    @property
    def outcome(self) -> Outcome:
        """The outcome; equal to its text: ``mission.outcome == "reached"``."""
        return self.run.verdict.outcome

    @property
    def reason(self) -> str:
        """The reason of the outcome, one sentence."""
        return self.run.verdict.reason

    @property
    def metrics(self) -> RunMetrics:
        """The metrics of the run."""
        return self.run.metrics

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults of plugins, each with file and line; without those that the mission injects.

        A test fails of them unless its marker says ``allow_faults=True``.
        """
        return self.run.faults

    @property
    def stack(self) -> str:
        """The name of the stack that drove."""
        return self.run.stack

    @property
    def log(self) -> RunLog:
        """The log of the run, one row per control tick."""
        return self.run.log

    @property
    def path(self) -> Array:
        """(n, 3) true poses x, y [m], yaw [rad] in the map, one per control tick."""
        return self.log.true

    @property
    def commands(self) -> Array:
        """(n, 3) time [s], v [m/s], w [rad/s], one per control tick."""
        return self.log.command_stream

    @property
    def command_hash(self) -> str:
        """The hash of the commands, equal for bit-identical commands."""
        return self.log.command_hash

    @property
    def seed(self) -> int:
        """The seed of the run."""
        return self.case.seed

    @cached_property
    def session(self) -> Session:
        """World, mission and stack, loaded and checked again; not driven."""
        return _prepared(self.case)

    @property
    def result(self) -> MissionResult:
        """All of the result. A run of the cache is driven again for it, command by command."""
        if not self.driven:
            self.driven.append(drive(self.case))
        return self.driven[0]

    def save(self) -> Path:
        """Write the run folder, with the recording, unless it exists; returns its path."""
        from navfw.missions.run_report import write_run
        from navfw.recording.run_folder import RunFolder

        if self.folder.exists():
            return self.folder
        kept = None if self.cache is None else self.cache.run_folder(self.case)
        with RunFolder(self.folder) as target:
            if kept is not None:
                shutil.copytree(kept, target.path, dirs_exist_ok=True)
            else:
                write_run(self.result, target)
        if self.cache is not None and kept is None:
            self.cache.keep_run_folder(self.case, self.folder)
        return self.folder
