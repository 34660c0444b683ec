"""One run: world, mission and stack; the drive, as a whole or tick by tick; its result.

``navfw.missions.session_setup`` makes a session from names.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self

from navfw.errors import InputError
from navfw.mapping import MapChange, changes_between, corrected_map, made_map
from navfw.missions.exploration_result import measure_exploration
from navfw.missions.failure_causes import failure_of
from navfw.missions.mission_events import EventClock, EventRecord
from navfw.missions.missionfile import MissionFile
from navfw.missions.missionspec import EventSpec
from navfw.missions.oracle import plugins_of, reveal
from navfw.missions.outcome import MissionVerdict, Outcome
from navfw.missions.pilot import TickView, Watcher, watcher_of
from navfw.missions.run_drawing import WindowOverlay, discs_of, outline_of
from navfw.missions.run_metrics import (
    RunResult,
    first_contacts,
    measure,
    shortest_with_room,
)
from navfw.missions.runner import MissionLoop, Task
from navfw.plugins.fault_injection import inject_faults
from navfw.plugins.simulator_access import plugin_files, simulator_users
from navfw.process import compile_kernels
from navfw.process.interruption import INTERRUPTED
from navfw.process.last_trace import name_plugins
from navfw.recording.channel_list import SeenRun
from navfw.recording.run_folder import EXPLORED, plain_json
from navfw.recording.run_observers import RunLog, RunRecorder
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.simulation import Simulation
from navfw.sim.world_changes import ChangeTrack, Walker, WalkerTrack
from navfw.sim.worldspec import WorldSpec
from navfw.stack import Stack
from navfw.topomap import TopoMap


@dataclass(frozen=True)
class Session:
    """World, mission and stack of a run, loaded and checked; ``run`` may be called repeatedly.

    ``shortest`` [m] is the length of the shortest path through all goals, in ``passable``: ``plan``
    with those doors open that events open. If not ``drawn``, camera images are blank, as for
    ``ideal`` flow. If ``coarse``, the physics takes longer steps.
    """

    world_name: str
    mission_name: str
    seed: int
    world: WorldSpec
    plan: SceneGeometry
    mission: MissionFile
    shortest: float
    passable: SceneGeometry
    stack_file: Path
    stack: Stack
    overrides: tuple[str, ...] = ()
    events: tuple[EventSpec, ...] = ()
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
            success_radius=self.success_radius,
            stuck_after=spec.stuck_after,
            drops=frozenset(drop.name for drop in self.world.drops),
        )

    @property
    def success_radius(self) -> float:
        """True distance [m] from a goal that counts as reached; infinite if none need be."""
        explore = self.mission.spec.explore
        home = explore is None or explore.return_home
        return self.mission.spec.success.within if home else math.inf

    def uninvited(self, faults: Sequence[str]) -> tuple[str, ...]:
        """Return those ``faults`` of plugins that the mission's events did not inject."""
        failing = (event.behavior.name for event in self.events if event.behavior)
        invited = tuple(f"behavior {name}: " for name in failing)
        return tuple(fault for fault in faults if not fault.startswith(invited))

    @property
    def seen(self) -> SeenRun:
        """The stack, outline and walkers of the run, for recordings and viewers."""
        return SeenRun(self.stack, outline_of(self.plan), partial(discs_of, self._walkers))

    @property
    def config(self) -> dict[str, Any]:
        """Mission and stack with all defaults, as plain data."""
        return {"mission": self.mission.resolved(), "stack": self.stack.config}

    @property
    def description(self) -> dict[str, str]:
        """The metadata of a recording: names, seed, and the configuration as JSON."""
        names = {"world": self.world_name, "mission": self.mission_name, "seed": str(self.seed)}
        return {**names, "config": json.dumps(plain_json(self.config))}

    def simulation(self, gui: bool = False) -> Simulation:
        """Start the simulator, the robot at the start; ``oracle: true`` stacks get its truth."""
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
        *watchers: Watcher,
        gui: bool = False,
        record: bool | RunRecorder = False,
        limit: float = math.inf,
        told: Callable[[Sequence[EventRecord]], object] = lambda _: None,
    ) -> MissionResult:
        """Drive the mission once; with ``record`` it is recorded, for a replay and for viewers.

        The recording is in a temporary file, or in that of a given ``RunRecorder``. ``watchers``
        are called with every tick, ``told`` with the events so far when one has begun or ended. A
        run that takes longer than ``limit`` [s] of wall-clock time ends as a fault.

        Raises:
            InputError: the stack refuses the mission before the robot has moved.

        """
        recorder = RunRecorder(self.description, self.seen) if record is True else record or None
        if recorder is not None:
            watchers = (*watchers, watcher_of(recorder.observe))
        name_plugins(plugin_files(plugins_of(self.stack)))
        with (
            recorder or nullcontext(),
            SteppedSession(self, *watchers, gui=gui, limit=limit, told=told) as drive,
            self.stack.guard.watchdog.on_duty(),
        ):
            drive.run()
            if recorder is not None:
                recorder.close()
            return replace(drive.result, recorder=recorder)


class SteppedSession(MissionLoop):
    """A mission to step through tick by tick; a context manager, and an iterator over its ticks.

    The commands are those of ``navfw.run`` with the same arguments, bit for bit. ``result`` is the
    mission's result, once it has ended. Compiled kernels that are missing are built first, unless
    ``compiled`` says that there are none.
    """

    def __init__(
        self,
        session: Session,
        *watchers: Watcher,
        gui: bool = False,
        limit: float = math.inf,
        told: Callable[[Sequence[EventRecord]], object] = lambda _: None,
        compiled: bool = False,
    ) -> None:
        if not compiled:
            compile_kernels(loaded=True)
        self.session = session
        stack, self._simulation = session.stack, session.simulation(gui)
        self._open = True
        if self._simulation.window is not None:
            watchers = (*watchers, WindowOverlay(self._simulation.window, stack).draw)
        targets = (
            inject_faults(stack.mofis.behaviors, event.behavior.name)
            if event.behavior
            else self._simulation
            for event in session.events
        )
        places = session.mission.topo_map.places
        events = EventClock(zip(session.events, targets, strict=True), places, told)
        driven = session.task, stack, self._simulation
        super().__init__(*driven, *watchers, events=events, limit=limit)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._open = False
        self._simulation.close()

    def step(self) -> TickView | None:
        """Drive one control tick and return it; None once the mission has ended.

        Raises:
            InputError: the session is not open, or the stack refuses the mission.
            KeyboardInterrupt: the user has stopped the run.

        """
        if not (self.ended or self._open):
            raise InputError("the session is not open: step inside `with open_session(...) as s:`")
        tick = super().step()
        if self.ended and self._open:
            self.__exit__()
            if self.verdict.outcome is Outcome.CANCELLED:
                raise KeyboardInterrupt
        return tick

    def explain(self) -> dict[str, Any]:
        """Explain why the last command was given, as plain data (``Stack.explain``)."""
        return self.session.stack.explain()

    @cached_property
    def result(self) -> MissionResult:
        """The result of the mission.

        Raises:
            InputError: the mission has not ended.

        """
        return MissionResult.of(self.session, self, self._simulation)


@dataclass(frozen=True, kw_only=True)
class MissionResult(RunResult):
    """The result of a run in this process, with the objects that it was made of.

    ``log`` has one row per control tick. ``movers`` has the positions of the world's movers over
    time, ``changes`` the solids that existed only for a part of the run.
    """

    session: Session = field(repr=False)
    verdict: MissionVerdict = field(repr=False)
    log: RunLog = field(repr=False)
    recorder: RunRecorder | None = field(default=None, repr=False)
    movers: WalkerTrack | None = field(default=None, repr=False)
    changes: ChangeTrack | None = field(default=None, repr=False)

    @classmethod
    def of(cls, session: Session, drive: MissionLoop, simulation: Simulation) -> MissionResult:
        """Compute the result of a ``drive`` in ``simulation``.

        Raises:
            InputError: the mission has not ended.

        """
        verdict, log, stack, mission = drive.verdict, drive.log, session.stack, session.mission
        movers = simulation.walker_track() if session.world.movers else None
        changes = simulation.change_track()
        permanent = tuple(s for s in session.plan.solids if s.name not in changes.names)
        start = mission.start.x, mission.start.y
        points = [start, *((goal.x, goal.y) for goal in mission.goals)]
        explored = measure_exploration(session, log, movers)
        metrics = measure(
            log,
            SceneGeometry(session.plan.bounds, permanent),
            start=start,
            goal=points[-1],
            within=mission.spec.success.within,
            shortest=session.shortest if explored is None else explored.tour_m,
            with_room=shortest_with_room(session.passable, points, mission.spec.robot.radius),
            discs=mission.spec.robot.discs,
            succeeded=verdict.outcome.succeeded,
            stage_ms=_stage_times(stack, simulation, drive.sim_time),
            moving=[track for track in (movers, changes) if track is not None],
        )
        oracles, failed = simulator_users(plugins_of(stack)), stack.guard.unreliable
        result = cls(
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
            real_time_factor=drive.sim_time / drive.wall_time if drive.wall_time > 0.0 else 0.0,
            collision_cause=simulation.collision_cause,
            contacts=tuple(first_contacts(log.contacts)),
            command_hash=log.command_hash,
            oracle=stack.resolved.settings.oracle or bool(oracles),
            oracle_plugins=oracles,
            map_changes=() if explored is not None else _map_changes(session),
            faults=tuple(map(str, stack.guard.faults)),
            objections=tuple(
                text for name, text in failed.items() if session.uninvited([f"{name}: "])
            ),
            notes=stack.state.notes,
            events=drive.events.log,
            exploration=explored,
            session=session,
            verdict=verdict,
            log=log,
            movers=movers,
            changes=changes,
        )
        return replace(result, assumed=session.mission.assumed, **failure_of(result))

    def explored_map(self, name: str) -> TopoMap:
        """Make the map of an exploration, called ``name``; InputError if nothing was explored."""
        made, plan = self._explored, self._explored.floor_plan
        return TopoMap(Path(name).stem, made.places.values(), made.passages, floor_plan=plan)

    @cached_property
    def _explored(self) -> TopoMap:
        growing = self.session.stack.growth.growing_map
        if self.exploration is None or not growing.keys:
            raise InputError("nothing was explored, so there is no map of it")
        return made_map(EXPLORED, growing.grid, growing.robot.radius, growing.drops)

    def corrected_map(self, name: str) -> TopoMap:
        """Return the mission's map with ``map_changes`` as ``name``; MapError if it is empty."""
        stack, radius = self.session.stack, self.session.mission.spec.robot.radius
        known = stack.planner.findings[2] or stack.topo_map
        return corrected_map(known, stack.growth.growing_map.grid, self.map_changes, radius, name)

    @property
    def exit_code(self) -> int:
        """0 if the mission succeeded without objections, 130 if the user stopped it, else 1."""
        if self.outcome is Outcome.CANCELLED:
            return INTERRUPTED
        return 0 if self.outcome.succeeded and not self.objections else 1


def _stage_times(stack: Stack, simulation: Simulation, sim_time: float) -> dict[str, float]:
    """Return the computing time [ms] per camera frame of the simulator's and the stack's stages."""
    spent = simulation.timings
    stages = {"render": spent.render, "physics": spent.physics, "sensors": spent.sensors}
    if stack.features.plugin.landmark_frames:
        stages["landmark_frames"] = spent.landmarks
    frames = max(1.0, sim_time * stack.robot.camera.rate)
    return {name: 1e3 * t / frames for name, t in {**stages, **stack.timings}.items()}


def _map_changes(session: Session) -> tuple[MapChange, ...]:
    """How the building was seen to differ from the map that the robot was given."""
    stack = session.stack
    growing = stack.growth.growing_map
    if not growing.begun:
        return ()
    growing.finish()
    closed, ways, _ = stack.planner.findings
    return tuple(changes_between(stack.topo_map, growing.grid, closed, ways, growing.last_seen))
