"""One run: world, mission and stack; the drive, whole or tick by tick; its result.

``navfw.missions.session_setup`` makes a session from names.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Self

from navfw.errors import InputError
from navfw.missions.mission_events import Event, EventClock, EventRecord
from navfw.missions.missionfile import MissionFile
from navfw.missions.oracle import plugins_of, reveal
from navfw.missions.outcome import MissionVerdict, Outcome
from navfw.missions.pilot import TickView
from navfw.missions.run_drawing import WindowOverlay, discs_of, outline_of
from navfw.missions.run_metrics import RunMetrics, first_contacts, measure, permanent_plan
from navfw.missions.run_result import RunResult
from navfw.missions.runner import Drive, MissionLoop, Progress, Task
from navfw.plugins.fault_injection import inject_faults
from navfw.plugins.simulator_access import plugin_files, simulator_users
from navfw.process import compile_kernels
from navfw.process.interruption import INTERRUPTED
from navfw.process.last_trace import name_plugins
from navfw.recording.channel_list import SeenRun
from navfw.recording.run_folder import plain_json
from navfw.recording.run_observers import RunLog, RunObserver, RunRecorder
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.simulation import Simulation
from navfw.sim.world_changes import ChangeTrack, Walker, WalkerTrack
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack


@dataclass(frozen=True)
class Session:
    """World, mission and stack of a run, loaded and checked; ``run`` may be called repeatedly.

    ``shortest`` [m] is the length of the shortest path through all goals. If not ``drawn``, images
    show nothing: for a stack with ``ideal`` flow. If ``coarse``, physics has longer steps.
    """

    world_name: str
    mission_name: str
    seed: int
    world: WorldSpec
    plan: SceneGeometry
    mission: MissionFile
    shortest: float
    stack_file: Path
    stack: Stack
    overrides: tuple[str, ...] = ()
    events: tuple[Event, ...] = ()
    drawn: bool = True
    coarse: bool = False
    # those of the newest simulation: truth, for recordings and viewers only
    _walkers: list[Walker] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def task(self) -> Task:
        """The part of the mission that the runner uses."""
        spec = self.mission.spec
        return Task(
            robot=spec.robot,
            start=self.mission.start,
            start_known=self.mission.start_known,
            goals=self.mission.goals,
            timeout=spec.timeout,
            success_radius=spec.success.within,
            stuck_after=spec.stuck_after,
            drops=frozenset(drop.name for drop in self.world.drops),
        )

    def uninvited(self, faults: Sequence[str]) -> tuple[str, ...]:
        """The ``faults`` of plugins that the mission's events did not inject."""
        invited = tuple(f"behavior {event.behavior}: " for event in self.events if event.behavior)
        return tuple(fault for fault in faults if not fault.startswith(invited))

    @property
    def seen(self) -> SeenRun:
        """What recordings and viewers show of a run."""
        return SeenRun(self.stack, outline_of(self.plan), partial(discs_of, self._walkers))

    @property
    def config(self) -> dict[str, Any]:
        """Mission and stack with all defaults, as plain data."""
        return {"mission": self.mission.resolved(), "stack": self.stack.config}

    @property
    def description(self) -> dict[str, str]:
        """What a recording tells of its run: names, seed, and the configuration as JSON."""
        names = {"world": self.world_name, "mission": self.mission_name, "seed": str(self.seed)}
        return {**names, "config": json.dumps(plain_json(self.config))}

    def simulation(self, gui: bool = False) -> Simulation:
        """The simulator, the robot at the start; a stack with ``oracle: true`` gets its truth."""
        spec = self.mission.spec
        simulation = Simulation(
            self.world,
            spec.robot,
            self.mission.start,
            self.seed,
            spec.sensors.resolved(),
            gui=gui,
            landmark_frames=self.stack.features.plugin.landmark_frames,
            drawn=self.drawn,
            coarse=self.coarse,
        )
        self._walkers[:] = simulation.walkers
        reveal(simulation, self.stack, drawn=self.drawn)
        return simulation

    def run(
        self,
        progress: Callable[[Progress], None] | None = None,
        *,
        gui: bool = False,
        record: bool | RunRecorder = False,
        observers: Sequence[RunObserver] = (),
        limit: float = math.inf,
        told: Callable[[Sequence[EventRecord]], object] = lambda _: None,
    ) -> MissionResult:
        """Drive the mission once; with ``record`` it is recorded, for a replay and for viewers.

        The recording is in a temporary file, or that of a ``recorder``. ``observers`` take in every
        tick, ``told`` the events so far when one has begun or ended. A run that takes longer than
        ``limit`` [s] of wall-clock time ends as a fault.

        Raises:
            InputError: the stack refuses the mission before the robot has moved.

        """
        recorder = RunRecorder(self.description, self.seen) if record is True else record or None
        observers = (*observers, *((recorder,) if recorder else ()))
        name_plugins(plugin_files(plugins_of(self.stack)))
        drive = SteppedSession(self, progress, gui=gui, observers=observers, limit=limit, told=told)
        with nullcontext() if recorder is None else recorder, drive as stepped:
            stepped.run()
            for observer in observers:
                observer.close()
            return stepped.measured(recorder)


class SteppedSession:
    """A mission to step through; a context manager, and an iterator over its ticks.

    The commands are those of ``navfw.run`` with the same arguments, bit for bit. ``result`` is the
    mission's result, once it has ended. Kernels of imported modules that are not compiled yet are
    compiled when the context begins, unless they are known to be ``compiled``.
    """

    def __init__(
        self,
        session: Session,
        progress: Callable[[Progress], None] | None = None,
        *,
        gui: bool = False,
        observers: Sequence[RunObserver] = (),
        limit: float = math.inf,
        told: Callable[[Sequence[EventRecord]], object] = lambda _: None,
        compiled: bool = False,
    ) -> None:
        self.session = session
        self._compiled = compiled
        self._gui = gui
        self._loop_options = (progress, observers, limit)
        self._told = told
        self._simulator: Simulation | None = None
        self._loop: MissionLoop | None = None
        self._result: MissionResult | None = None

    def __enter__(self) -> Self:
        if not self._compiled:
            compile_kernels(loaded=True)
        self._simulator = simulator = self.session.simulation(self._gui)
        try:
            session, (progress, observers, limit) = self.session, self._loop_options
            stack, behaviors = session.stack, session.stack.mofis.behaviors
            if simulator.window is not None:
                observers = (*observers, WindowOverlay(simulator.window, stack))
            targets = (
                inject_faults(behaviors, event.behavior) if event.behavior else simulator
                for event in session.events
            )
            events = EventClock(zip(session.events, targets, strict=True), self._told)
            loop = MissionLoop(session.task, stack, simulator, progress, observers, events, limit)
            self._loop = loop
        except BaseException:
            self._simulator = None
            simulator.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        simulator, self._simulator = self._simulator, None
        if simulator is not None:
            simulator.close()

    def __iter__(self) -> Iterator[TickView]:
        return iter(self.step, None)

    @property
    def ended(self) -> bool:
        """Whether the mission has ended."""
        return self._loop is not None and self._loop.verdict is not None

    def run(self) -> None:
        """Drive to the end."""
        with self.session.stack.guard.watchdog.on_duty():
            self._opened().run()

    def step(self) -> TickView | None:
        """Drive one control tick; None once the mission has ended.

        Raises:
            InputError: the session is not open, or the stack refuses the mission.
            KeyboardInterrupt: the user has stopped the run.

        """
        if self.ended:
            return None
        loop = self._opened()
        tick = loop.step()
        if loop.verdict is not None:
            self._result = self.measured()
            self.__exit__()
            if loop.verdict.outcome == "cancelled":
                raise KeyboardInterrupt
        return tick

    def explain(self) -> dict[str, Any]:
        """Why the last command was given, as plain data (``Stack.explain``)."""
        return self.session.stack.explain()

    @property
    def result(self) -> MissionResult:
        """The result of the mission.

        Raises:
            InputError: the mission has not ended.

        """
        if self._result is None:
            raise InputError("the mission has not ended: step until `ended`")
        return self._result

    def measured(self, recorder: RunRecorder | None = None) -> MissionResult:
        """The result of the mission, which has ended, before the context ends."""
        drive, oracles = self._opened().result(), simulator_users(plugins_of(self.session.stack))
        assert self._simulator is not None  # noqa: S101 - it is open
        return MissionResult.of(self.session, drive, self._simulator, recorder, oracles)

    def _opened(self) -> MissionLoop:
        """The loop; raises InputError unless the context lasts."""
        if self._simulator is None or self._loop is None:
            raise InputError("the session is not open: use it as in `with open_session(...) as s:`")
        return self._loop


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
