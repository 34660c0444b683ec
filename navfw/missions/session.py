"""One run: world, mission and stack; the drive, whole or tick by tick; its result.

``navfw.missions.session_setup`` makes a session from names.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self

from navfw.errors import InputError
from navfw.missions import run_metrics
from navfw.missions.mission_events import Event, EventClock, EventRecord
from navfw.missions.missionfile import MissionFile
from navfw.missions.oracle import plugins_of, reveal
from navfw.missions.outcome import Outcome
from navfw.missions.pilot import TickView
from navfw.missions.run_drawing import WindowOverlay, discs_of, outline_of
from navfw.missions.runner import MissionLoop, Progress, RunResult, Task
from navfw.plugins.fault_injection import inject_faults
from navfw.plugins.simulator_access import plugin_files, simulator_users
from navfw.process import compile_kernels
from navfw.process.interruption import INTERRUPTED
from navfw.process.last_trace import name_plugins
from navfw.recording.channel_list import SeenRun
from navfw.recording.run_folder import plain_json
from navfw.recording.run_observers import RunObserver, RunRecorder
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
        return {
            "world": self.world_name,
            "mission": self.mission_name,
            "seed": str(self.seed),
            "config": json.dumps(plain_json(self.config)),
        }

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
            run = stepped.run()
            for observer in observers:
                observer.close()
        return stepped.result_of(run, recorder)


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
        self._of_simulator: dict[str, Any] = {}
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
        if simulator is None:
            return
        spent, stack = simulator.timings, self.session.stack
        larger = stack.features.plugin.landmark_frames
        self._of_simulator = {
            "timings": {
                "render": spent.render,
                "physics": spent.physics,
                "sensors": spent.sensors,
                **({"landmark_frames": spent.landmarks} if larger else {}),
                **stack.timings,
            },
            "collision_cause": simulator.collision_cause,
            "movers": simulator.walker_track() if self.session.world.movers else None,
            "changes": simulator.change_track(),
        }
        simulator.close()

    def __iter__(self) -> Iterator[TickView]:
        return iter(self.step, None)

    @property
    def ended(self) -> bool:
        """Whether the mission has ended."""
        return self._loop is not None and self._loop.verdict is not None

    def run(self) -> RunResult:
        """Drive to the end."""
        with self.session.stack.guard.watchdog.on_duty():
            return self._opened().run()

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
            run = loop.result()
            self.__exit__()
            self._result = self.result_of(run)
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

    def result_of(self, run: RunResult, recorder: RunRecorder | None = None) -> MissionResult:
        """The result of the whole ``run``, after the context has ended."""
        return MissionResult(
            self.session,
            run,
            recorder=recorder,
            oracle_plugins=simulator_users(plugins_of(self.session.stack)),
            unreliable=self.session.stack.guard.unreliable,
            **self._of_simulator,
        )

    def _opened(self) -> MissionLoop:
        """The loop; raises InputError unless the context lasts."""
        if self._simulator is None or self._loop is None:
            raise InputError("the session is not open: use it as in `with open_session(...) as s:`")
        return self._loop


@dataclass(frozen=True)
class MissionResult:
    """Outcome and metrics of a run.

    ``collision_cause`` is "mover" when a mover ran into a robot that was not driving towards it,
    "robot" for any other collision, None without one. ``movers`` has the positions of the world's
    movers over time, ``changes`` the solids that existed for a part of the run only.
    ``oracle_plugins`` names the plugins that use the simulator, declared or by their source.
    ``unreliable`` are those that failed in more than a tenth of their calls (``PluginGuard``).
    """

    session: Session
    run: RunResult
    timings: dict[str, float] = field(default_factory=dict)
    recorder: RunRecorder | None = None
    collision_cause: str | None = None
    movers: WalkerTrack | None = None
    changes: ChangeTrack | None = None
    oracle_plugins: tuple[str, ...] = ()
    unreliable: Mapping[str, str] = field(default_factory=dict)

    @property
    def outcome(self) -> Outcome:
        """The outcome."""
        return self.run.verdict.outcome

    @property
    def reason(self) -> str:
        """The reason of the outcome, one sentence."""
        return self.run.verdict.reason

    @property
    def uninvited_faults(self) -> list[str]:
        """The faults of plugins that the mission's events did not inject."""
        return [fault for fault in self.run.faults if not fault.startswith(self._injected)]

    @property
    def objections(self) -> list[str]:
        """The plugins that failed in more than a tenth of their calls, and in how many of them."""
        return [t for name, t in self.unreliable.items() if f"{name}: " not in self._injected]

    @property
    def exit_code(self) -> int:
        """That of ``navfw run``: 0 for an accomplished mission without objections, else 1.

        130 for a run that was stopped by the user.
        """
        if self.outcome is Outcome.CANCELLED:
            return INTERRUPTED
        return 0 if self.outcome.succeeded and not self.objections else 1

    @property
    def _injected(self) -> tuple[str, ...]:
        """Beginnings of the faults that the mission's events injected."""
        return tuple(f"behavior {e.behavior}: " for e in self.session.events if e.behavior)

    @cached_property
    def metrics(self) -> run_metrics.RunMetrics:
        """The metrics of the run."""
        session, run = self.session, self.run
        frames = max(1.0, run.sim_time * session.mission.spec.robot.camera.rate)
        start, goal = session.mission.start, session.mission.goals[-1]
        return run_metrics.measure(
            run.log,
            run_metrics.permanent_plan(session.plan, self.changes),
            start=(start.x, start.y),
            goal=(goal.x, goal.y),
            within=session.mission.spec.success.within,
            shortest=session.shortest,
            discs=session.mission.spec.robot.discs,
            succeeded=self.outcome.succeeded,
            stage_ms={name: 1e3 * t / frames for name, t in self.timings.items()},
            moving=[track for track in (self.movers, self.changes) if track is not None],
        )

    def summary(self) -> dict[str, Any]:
        """The content of ``navfw run --json``: one flat object."""
        run, verdict, measured = self.run, self.run.verdict, asdict(self.metrics)
        del measured["traversal_s"]
        return {
            "outcome": str(verdict.outcome),
            "reason": verdict.reason,
            "world": self.session.world_name,
            "mission": self.session.mission_name,
            "seed": self.session.seed,
            "behavior": verdict.behavior,
            "tick": verdict.tick,
            "sim_time_s": run.sim_time,
            "wall_time_s": run.wall_time,
            "real_time_factor": run.real_time_factor,
            "mean_speed_m_s": measured.pop("mean_speed"),
            **measured.pop("localization"),
            **measured,
            "collision_cause": self.collision_cause,
            "contacts": [*map(asdict, run_metrics.first_contacts(run.log.contacts))],
            "command_hash": run.log.command_hash,
            "oracle": self.session.stack.resolved.settings.oracle or bool(self.oracle_plugins),
            "oracle_plugins": list(self.oracle_plugins),
            "faults": run.faults,
            "objections": self.objections,
            "events": [event.as_data() for event in run.events],
        }
