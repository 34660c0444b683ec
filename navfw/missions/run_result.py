"""The result of a run: its fields have the names of ``navfw run --json``.

The JSON, the row of a suite, the page and the lines of the terminal are views of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

from navfw.missions.mission_events import EventRecord
from navfw.missions.outcome import MissionVerdict, Outcome
from navfw.missions.run_metrics import RunMetrics, first_contacts, measure, permanent_plan
from navfw.process.interruption import INTERRUPTED
from navfw.recording.run_observers import Contact, RunLog, RunRecorder

if TYPE_CHECKING:
    from navfw.missions.runner import Drive
    from navfw.missions.session import Session
    from navfw.sim.simulation import Simulation
    from navfw.sim.world_changes import ChangeTrack, WalkerTrack


@dataclass(frozen=True, kw_only=True)
class RunResult(RunMetrics):
    """Outcome and metrics of a run, as plain data.

    ``collision_cause`` is "mover" when a mover ran into a robot that was not driving towards it,
    "robot" for any other collision, None without one; ``contacts`` has the first contact of each.
    ``oracle_plugins`` names the plugins that use the simulator's truth, declared or by their
    source. ``faults`` are what plugins did wrong, ``objections`` the plugins that failed in more
    than a tenth of their calls, but for those that the mission's events made fail.
    """

    outcome: Outcome
    reason: str
    world: str
    mission: str
    seed: int
    behavior: str
    tick: int
    sim_time_s: float
    wall_time_s: float
    real_time_factor: float
    collision_cause: str | None
    contacts: tuple[Contact, ...]
    command_hash: str
    oracle: bool
    oracle_plugins: tuple[str, ...]
    faults: tuple[str, ...]
    objections: tuple[str, ...]
    events: tuple[EventRecord, ...]

    @property
    def metrics(self) -> RunMetrics:
        """The metrics among the fields: ``result.metrics.spl`` is ``result.spl``."""
        return self

    def summary(self) -> dict[str, Any]:
        """The content of ``navfw run --json``: one flat object, the outcome first."""
        metrics = {one.name for one in fields(RunMetrics)}
        names = sorted((one.name for one in fields(RunResult)), key=metrics.__contains__)
        return {
            **{name: getattr(self, name) for name in names},
            "outcome": str(self.outcome),
            "contacts": [*map(asdict, self.contacts)],
            "events": [event.as_data() for event in self.events],
        }


@dataclass(frozen=True, kw_only=True)
class MissionResult(RunResult):
    """The result of a run in this process, with what it was made of.

    ``log`` has one row per control tick. ``movers`` has the positions of the world's movers over
    time, ``changes`` the solids that existed for a part of the run only.
    """

    session: Session = field(repr=False)
    verdict: MissionVerdict = field(repr=False)
    log: RunLog = field(repr=False)
    recorder: RunRecorder | None = field(default=None, repr=False)
    movers: WalkerTrack | None = field(default=None, repr=False)
    changes: ChangeTrack | None = field(default=None, repr=False)

    @classmethod
    def of(
        cls,
        session: Session,
        drive: Drive,
        simulation: Simulation,
        recorder: RunRecorder | None = None,
        oracle_plugins: Sequence[str] = (),
    ) -> MissionResult:
        """The result of a ``drive`` in ``simulation``."""
        verdict, log, stack = drive.verdict, drive.log, session.stack
        movers = simulation.walker_track() if session.world.movers else None
        changes = simulation.change_track()
        metrics = _measured(session, drive, simulation, movers, changes)
        failed = stack.guard.unreliable
        return cls(
            **vars(metrics),
            outcome=verdict.outcome,
            reason=verdict.reason,
            world=session.world_name,
            mission=session.mission_name,
            seed=session.seed,
            behavior=verdict.behavior,
            tick=verdict.tick,
            sim_time_s=drive.sim_time,
            wall_time_s=drive.wall_time,
            real_time_factor=drive.real_time_factor,
            collision_cause=simulation.collision_cause,
            contacts=tuple(first_contacts(log.contacts)),
            command_hash=log.command_hash,
            oracle=stack.resolved.settings.oracle or bool(oracle_plugins),
            oracle_plugins=tuple(oracle_plugins),
            faults=drive.faults,
            objections=tuple(
                text for name, text in failed.items() if session.uninvited([f"{name}: "])
            ),
            events=drive.events,
            session=session,
            verdict=verdict,
            log=log,
            recorder=recorder,
            movers=movers,
            changes=changes,
        )

    @property
    def exit_code(self) -> int:
        """That of ``navfw run``: 0 for an accomplished mission without objections, else 1.

        130 for a run that was stopped by the user.
        """
        if self.outcome is Outcome.CANCELLED:
            return INTERRUPTED
        return 0 if self.outcome.succeeded and not self.objections else 1


def _measured(
    session: Session,
    drive: Drive,
    simulation: Simulation,
    movers: WalkerTrack | None,
    changes: ChangeTrack | None,
) -> RunMetrics:
    """The metrics of a ``drive``."""
    spec, start, goal = session.mission.spec, session.mission.start, session.mission.goals[-1]
    spent, stack = simulation.timings, session.stack
    stages = {"render": spent.render, "physics": spent.physics, "sensors": spent.sensors}
    if stack.features.plugin.landmark_frames:
        stages["landmark_frames"] = spent.landmarks
    frames = max(1.0, drive.sim_time * spec.robot.camera.rate)
    return measure(
        drive.log,
        permanent_plan(session.plan, changes),
        start=(start.x, start.y),
        goal=(goal.x, goal.y),
        within=spec.success.within,
        shortest=session.shortest,
        discs=spec.robot.discs,
        succeeded=drive.verdict.outcome.succeeded,
        stage_ms={name: 1e3 * t / frames for name, t in {**stages, **stack.timings}.items()},
        moving=[track for track in (movers, changes) if track is not None],
    )
