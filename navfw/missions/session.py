"""One run from names to results: find files, check them, build the stack, drive, evaluate.

>>> session = prepare("office", "lobby-to-lab", seed=1)      # doctest: +SKIP
>>> result = session.run()                                   # doctest: +SKIP
>>> result.outcome, result.reason                            # doctest: +SKIP
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.config.lookup import find, find_mission
from navfw.config.overrides import Settings, override_texts
from navfw.missions.changing_world import CombinedClearance, permanent_plan
from navfw.missions.event_check import resolve_events, with_doors_open
from navfw.missions.event_clock import Event, EventClock, EventTarget
from navfw.missions.eventspec import BehaviorFault
from navfw.missions.mission_drive import MissionDrive
from navfw.missions.missionfile import MissionFile, load_mission
from navfw.missions.oracle import reveal
from navfw.missions.outcome import Outcome
from navfw.missions.process_check import check_process
from navfw.missions.process_state import ProcessState
from navfw.missions.resolved_config import run_description
from navfw.missions.run_metrics import RunMetrics, measure
from navfw.missions.run_options import chosen_stack, split_overrides
from navfw.missions.runner import MissionLoop, Progress, RunResult, Task
from navfw.missions.world_outline import outline_of
from navfw.plugins.fault_injection import FaultInjector, inject_faults
from navfw.recording.run_observer import RunObserver, SeenRun
from navfw.recording.run_recorder import RunRecorder
from navfw.sim.floorplan import FloorPlan
from navfw.sim.movers import MoverTrack
from navfw.sim.simulation import Simulation
from navfw.sim.world_changes import ChangeTrack
from navfw.sim.world_check import check_world
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack

if TYPE_CHECKING:
    from navfw.plugins import Registry


@dataclass(frozen=True)
class Session:
    """World, mission and stack of a run, loaded and checked; ``run`` may be called repeatedly.

    ``shortest`` [m] is the length of the shortest path through all goals.
    """

    world_name: str
    mission_name: str
    seed: int
    world: WorldSpec
    plan: FloorPlan
    mission: MissionFile
    shortest: float
    stack_file: Path
    stack: Stack
    overrides: tuple[str, ...] = ()
    events: tuple[Event, ...] = ()

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
        return SeenRun(self.stack, outline_of(self.plan))

    def simulation(self, gui: bool = False) -> Simulation:
        """The simulator, the robot at the start; a stack with ``oracle: true`` gets its truth."""
        spec = self.mission.spec
        sensors = spec.sensors.resolved()
        simulation = Simulation(
            self.world,
            spec.robot,
            self.mission.start,
            self.seed,
            sensors,
            gui=gui,
            landmark_frames=self.stack.features.landmark_frames,
        )
        reveal(simulation, self.stack)
        return simulation

    def run(
        self,
        progress: Callable[[Progress], None] | None = None,
        *,
        gui: bool = False,
        record: bool = False,
        observers: Sequence[RunObserver] = (),
        limit: float = math.inf,
    ) -> MissionResult:
        """Drive the mission once; with ``record`` it is recorded, for a replay and for viewers.

        ``observers`` take in every tick. A run that takes longer than ``limit`` [s] of wall-clock
        time ends as a fault.

        Raises:
            InputError: the stack refuses the mission before the robot has moved.

        """
        recorder = RunRecorder(run_description(self), self.seen) if record else None
        observers = (*observers, *((recorder,) if recorder else ()))
        before = ProcessState.capture()
        with self.drive(progress, gui=gui, observers=observers, limit=limit) as drive:
            run = drive.run()
            for observer in observers:
                observer.close()
        run = check_process(run, before, self.stack.resolved.plugins)
        return self.result(drive, run, recorder)

    def drive(
        self,
        progress: Callable[[Progress], None] | None = None,
        *,
        gui: bool = False,
        observers: Sequence[RunObserver] = (),
        limit: float = math.inf,
    ) -> MissionDrive:
        """One drive of the mission, a context manager, to be run whole or tick by tick."""

        def loop(simulator: Simulation) -> MissionLoop:
            clock = EventClock((event, self._target(event, simulator)) for event in self.events)
            return MissionLoop(self.task, self.stack, simulator, progress, observers, clock, limit)

        return MissionDrive(self.stack, lambda: self.simulation(gui), loop)

    def result(
        self, drive: MissionDrive, run: RunResult, recorder: RunRecorder | None = None
    ) -> MissionResult:
        """The result of a drive whose context has ended."""
        movers = drive.movers if self.world.movers else None
        parts = (drive.timings, recorder, drive.cause, movers, drive.changes, drive.watch.found())
        return MissionResult(self, run, *parts)

    def _target(self, event: Event, simulator: Simulation) -> EventTarget:
        """A behaviour of the stack for a behaviour's fault, else the simulation."""
        action = event.action
        if isinstance(action, BehaviorFault):
            return _BehaviorFaultTarget(inject_faults(self.stack.mofis.behaviors, action.name))
        return simulator


class _BehaviorFaultTarget:
    """Applies events to a behaviour through its fault injector."""

    def __init__(self, injector: FaultInjector) -> None:
        self._injector = injector

    def begin(self, action: BehaviorFault) -> None:
        self._injector.begin(action.does)

    def end(self, action: BehaviorFault) -> None:
        self._injector.end(action.does)


@dataclass(frozen=True)
class MissionResult:
    """Outcome and metrics of a run.

    ``collision_cause`` is "mover" when a mover ran into a robot that was not driving towards it,
    "robot" for any other collision, None without one. ``movers`` has the positions of the world's
    movers over time, ``changes`` the solids that existed for a part of the run only.
    ``oracle_plugins`` names the plugins that used the simulator's truth, declared or found out.
    """

    session: Session
    run: RunResult
    timings: dict[str, float] = field(default_factory=dict)
    recorder: RunRecorder | None = None
    collision_cause: str | None = None
    movers: MoverTrack | None = None
    changes: ChangeTrack | None = None
    oracle_plugins: tuple[str, ...] = ()

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
        actions = [event.action for event in self.session.events]
        injected = tuple(f"behavior {a.name}: " for a in actions if isinstance(a, BehaviorFault))
        return [fault for fault in self.run.faults if not fault.startswith(injected)]

    @cached_property
    def metrics(self) -> RunMetrics:
        """The metrics of the run."""
        session, run = self.session, self.run
        frames = max(1.0, run.sim_time * session.mission.spec.robot.camera.rate)
        start, goal = session.mission.start, session.mission.goals[-1]
        return measure(
            run.log,
            permanent_plan(session.plan, self.changes),
            start=(start.x, start.y),
            goal=(goal.x, goal.y),
            within=session.mission.spec.success.within,
            shortest=session.shortest,
            discs=session.mission.spec.robot.discs,
            succeeded=self.outcome.succeeded,
            stage_ms={name: 1e3 * t / frames for name, t in self.timings.items()},
            moving=CombinedClearance(self.movers, self.changes),
        )

    def summary(self) -> dict[str, Any]:
        """The content of ``navfw run --json``: one flat object."""
        run, verdict, metrics = self.run, self.run.verdict, self.metrics
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
            "path_length_m": metrics.path_length_m,
            "shortest_path_m": metrics.shortest_path_m,
            "spl": metrics.spl,
            "collisions": metrics.collisions,
            "collision_cause": self.collision_cause,
            "min_clearance_m": metrics.min_clearance_m,
            "clearance_p05_m": metrics.clearance_p05_m,
            "distance_to_goal_m": metrics.distance_to_goal_m,
            "estimate_error_m": metrics.estimate_error_m,
            "estimate_error_max_m": metrics.estimate_error_max_m,
            **asdict(metrics.localization),
            "mean_speed_m_s": metrics.mean_speed,
            "emergencies": metrics.emergencies,
            "command_hash": run.log.command_hash,
            "oracle": self.session.stack.resolved.settings.oracle or bool(self.oracle_plugins),
            "oracle_plugins": list(self.oracle_plugins),
            "faults": run.faults,
            "events": [event.as_data() for event in run.events],
            "stage_ms": metrics.stage_ms,
        }


def prepare(
    world: str | Path,
    mission: str | Path,
    *,
    seed: int = 0,
    stack: str | Path | None = None,
    overrides: Settings = (),
    registry: Registry | None = None,
) -> Session:
    """Load and check world, mission, map and stack.

    ``stack`` is that of ``chosen_stack``.
    ``overrides`` that begin with ``mission.`` (``mission.timeout=60``), ``robot.`` or ``sensors.``
    apply to the mission, all others (``offis.layers=1``) to the stack.

    Raises:
        InputError: one of them does not exist, breaks its schema, or contradicts another; the
            message has file, line and key.

    """
    overrides = override_texts(overrides)
    for_mission, for_stack = split_overrides(overrides)
    world_file = find("world", world)
    mission_file = find_mission(world, mission)
    world_spec = load_world(world_file)
    loaded = load_mission(mission_file, for_mission)
    world_spec = with_drops(world_spec, loaded)
    height = loaded.spec.robot.height
    plan = FloorPlan.from_world(world_spec, height)
    opened = FloorPlan.from_world(with_doors_open(world_spec, loaded.spec.events), height)
    loaded = loaded.placed(seed, opened)
    shortest = loaded.check(opened)
    stack_file = chosen_stack(loaded, stack)
    registry = registry or _registry()
    built = Stack.load(stack_file, loaded.spec.robot, loaded.topo_map, registry, for_stack)
    return Session(
        world_name=world_file.parent.name,
        mission_name=mission_file.stem,
        seed=seed,
        world=world_spec,
        plan=plan,
        mission=loaded,
        shortest=shortest,
        stack_file=stack_file,
        stack=built,
        overrides=overrides,
        events=resolve_events(
            loaded.document,
            loaded.spec.events,
            loaded.spec.timeout,
            loaded.topo_map,
            world_spec,
            built,
            registry,
        ),
    )


def with_drops(world: WorldSpec, mission: MissionFile) -> WorldSpec:
    """The world with the drops that the mission adds to its floor.

    Raises:
        WorldError: a drop contradicts the world; the message has the mission's file, line and key.

    """
    drops = mission.spec.drops
    if not drops:
        return world
    changed = world.model_copy(update={"drops": (*drops, *world.drops)})
    # the world has been checked, and the mission's drops come first: indices are those of its file
    check_world(changed, file=mission.file, line_of=mission.document.line_of)
    return changed


def _registry() -> Registry:
    from navfw.plugins import default_registry

    return default_registry()
