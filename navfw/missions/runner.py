"""The closed loop of a mission: it passes sensor readings to the stack, its twist to the wheels."""

from __future__ import annotations

import gc
import math
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from navfw.errors import InputError
from navfw.guard import PluginCallError
from navfw.missions.mission_events import EventClock
from navfw.missions.outcome import (
    Cause,
    GoalChecker,
    MissionVerdict,
    Outcome,
    ProgressChecker,
    goal_name,
)
from navfw.missions.pilot import Pilot, Simulator, TickView, Watcher
from navfw.process.interruption import check_interrupted, interruptible
from navfw.recording.run_observers import Contact, RunLog, RunLogger
from navfw.robot import RobotModel
from navfw.signals import Pose, SensorReading, Twist, Waypoint

_SETTLE_TIME = 2.0
"""Longest time [s] to wait for standstill after the stack reports that it has finished."""

_EMERGENCY = "emergency"
"""Name of the behaviour whose commands count as emergency commands."""

_FAULTS = {
    "sensor": Cause.SENSOR_FAILED,
    "sight": Cause.NOTHING_SEEN,
    "stage": Cause.PLUGIN_FAILED,
}
"""Cause of the fault, by the part of the stack that has failed permanently."""

_STILL = 0.02
"""Commanded speed [m/s] and turning rate [rad/s] up to which the robot counts as standing still."""

_STALL_RADIUS = 0.3
"""A robot that stays within this distance [m] of one position makes no progress."""


@dataclass(frozen=True, slots=True)
class Task:
    """The part of a mission that the loop uses.

    A goal counts as visited when the robot's true distance is at most ``success_radius`` [m]; the
    last goal, when the stack has also finished. The stack gets the true ``start`` only if
    ``start_known``. ``timeout`` [s] is simulated time. A robot without progress for ``stuck_after``
    [s] is stuck. Contacts named in ``drops`` are reported as falls.
    """

    robot: RobotModel
    start: Pose
    goals: tuple[Waypoint, ...]
    timeout: float
    success_radius: float = 0.5
    stuck_after: float = 45.0
    start_known: bool = True
    drops: frozenset[str] = frozenset()


class MissionLoop:
    """One run of a mission, as an iterator over its control ticks.

    ``watchers`` are called with every tick. A run that takes longer than ``limit`` [s] of
    wall-clock time ends as a fault; otherwise that time is only reported.
    """

    def __init__(
        self,
        task: Task,
        pilot: Pilot,
        simulator: Simulator,
        *watchers: Watcher,
        events: EventClock | None = None,
        limit: float = math.inf,
    ) -> None:
        self.task = task
        self.pilot = pilot
        self.simulator = simulator
        self.watchers = watchers
        self.events = events or EventClock(())
        self.limit = limit
        self._verdict: MissionVerdict | None = None
        self.logger = RunLogger()
        self.goal_checker = GoalChecker(task.goals, task.success_radius)
        self.progress_checker = ProgressChecker(task.stuck_after, _STALL_RADIUS)
        self.finished_at: float | None = None
        self.last_leader = ""
        self.began = time.perf_counter()
        self.first = simulator.time
        self.wall_time = 0.0
        self._ticks = self._contained_ticks()

    def __iter__(self) -> Iterator[TickView]:
        return iter(self.step, None)

    def run(self) -> Self:
        """Drive until the mission ends; Ctrl-C or SIGTERM ends it as cancelled.

        Raises:
            InputError: the stack refuses the mission before the first tick, for example a goal to
                which the map has no route. Any later exception ends the run as a fault.

        """
        # garbage collection leaves out what is older than the run: one pass over it costs 0.1 s
        gc.freeze()
        try:
            with self._contained(), interruptible():
                for _ in self._ticks:
                    check_interrupted()
        finally:
            gc.unfreeze()
        return self

    def step(self) -> TickView | None:
        """Drive one control tick and return it; None if the mission has ended or failed.

        Raises:
            InputError: as ``run``.

        """
        return next(self._ticks, None)

    @property
    def ended(self) -> bool:
        """Whether the mission has ended."""
        return self._verdict is not None

    @property
    def verdict(self) -> MissionVerdict:
        """The verdict of a mission that has ended.

        Raises:
            InputError: the mission has not ended.

        """
        if self._verdict is None:
            raise InputError("the mission has not ended: step until `ended`")
        return self._verdict

    @property
    def log(self) -> RunLog:
        """The log of all ticks so far."""
        return self.logger.log()

    @property
    def sim_time(self) -> float:
        """Simulated time [s] since the loop was made."""
        return self.simulator.time - self.first

    @contextmanager
    def _contained(self) -> Iterator[None]:
        """An exception inside this context ends the run by a verdict."""
        try:
            try:
                yield
            except Exception:
                check_interrupted()  # compiled code may raise another error than the interruption
                raise
        except KeyboardInterrupt:
            self._verdict = self._end(Outcome.CANCELLED, "stopped by the user")
        except PluginCallError as error:
            self._verdict = self._fault(Cause.PLUGIN_FAILED, str(error))
        except Exception as error:  # a plugin may raise anything; the run still gives a result
            if isinstance(error, InputError) and self.logger.ticks == 0:
                raise
            what = f"{type(error).__name__}: {error}".splitlines()[0]
            trace = traceback.format_exc()
            self._verdict = self._fault(Cause.EXCEPTION, f"exception: {what}", trace)

    def _contained_ticks(self) -> Iterator[TickView]:
        with self._contained():
            yield from self._drive()

    def _drive(self) -> Iterator[TickView]:
        """Drive, tick by tick, until there is a verdict."""
        task, pilot, simulator = self.task, self.pilot, self.simulator
        pilot.start(task.start if task.start_known else None, task.goals)
        while self._verdict is None:
            pose = simulator.true_pose()
            self.events.tick(simulator.time, pose)
            reading = simulator.read()
            twist = pilot.step(reading)
            if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
                what = f"the stack commanded v = {twist.v}, w = {twist.w}"
                self._verdict = self._fault(Cause.BAD_COMMAND, what)
                return
            tick = TickView(
                reading,
                pilot.state,
                np.array([twist.v, twist.w]),
                np.array([pose.x, pose.y, pose.yaw]),
            )
            self._record(reading, pose, twist)
            for watch in self.watchers:
                watch(tick)
            simulator.drive(*task.robot.wheel_speeds(twist))
            simulator.advance(1.0 / task.robot.control_rate)
            self._verdict = self._judge(reading.time, simulator.true_pose(), twist)
            self.wall_time = time.perf_counter() - self.began
            if self._verdict is None and self.wall_time > self.limit:
                what = f"wall-clock limit of {self.limit:g} s"
                self._verdict = self._fault(Cause.TOO_LONG, what)
            yield tick

    def _record(self, reading: SensorReading, pose: Pose, twist: Twist) -> None:
        state = self.pilot.state
        command = state.command
        leader = "" if command is None else command.leader
        self.last_leader = leader or self.last_leader
        self.logger.add(
            time=reading.time,
            true=pose,
            estimate=self.task.start if state.belief is None else state.belief.pose,
            twist=twist,
            leader=leader,
            emergency=command is not None and (command.emergency or leader == _EMERGENCY),
            belief=state.belief,
            sight=state.sight,
            vetoed=bool(state.veto),
            slower=state.slower,
        )
        self.logger.add_waypoints(state.path)

    def _judge(self, now: float, pose: Pose, twist: Twist) -> MissionVerdict | None:
        """Return the verdict if the mission ends at this tick; a collision takes precedence."""
        self.goal_checker.update(pose)
        if contacts := self.simulator.contacts:
            touched = list(dict.fromkeys(contacts))
            self.logger.contacts.extend(Contact(now, pose.x, pose.y, body) for body in touched)
            where = f"at ({pose.x:.2f}, {pose.y:.2f})"
            fell = [repr(name) for name in touched if name in self.task.drops]
            did = f"fell into {', '.join(fell)}" if fell else f"touched {', '.join(touched)}"
            return self._end(Outcome.COLLIDED, f"{did} {where}")
        state = self.pilot.state
        if state.finished:
            return self._finish(now, pose, twist)
        if state.fault is not None:
            return self._fault(_FAULTS[state.fault.part], state.fault.reason)
        if state.stuck:
            return self._end(Outcome.UNSURE if state.unsure else Outcome.STUCK, state.stuck)
        if self.progress_checker.update(now, pose):
            limit = f"{_STALL_RADIUS:g} m of one position for {self.task.stuck_after:g} s"
            outcome = Outcome.UNSURE if state.unsure else Outcome.STUCK
            held = f"; held by the safety monitor: {state.veto}" if state.veto else ""
            return self._end(outcome, f"stayed within {limit}{held}")
        return self._time_is_up(pose) if now >= self.task.timeout else None

    def _time_is_up(self, pose: Pose) -> MissionVerdict:
        """Lost if the belief is lost, unsure at a goal by the estimate; otherwise a timeout."""
        goal = self.goal_checker
        reason = f"time limit of {self.task.timeout:g} s, {goal.distance(pose):.1f} m from"
        reason += f" {goal_name(goal.goal)}"
        belief = self.pilot.state.belief
        if belief is not None and belief.lost:
            reason += ", position estimate lost"
            fitting = f": {belief.hypotheses} places fit" if belief.hypotheses > 1 else ""
            return self._end(Outcome.LOST, reason + fitting)
        if self.pilot.state.unsure:
            return self._end(Outcome.UNSURE, f"{reason}, position estimate too uncertain")
        return self._end(Outcome.TIMEOUT, reason)

    def _finish(self, now: float, pose: Pose, twist: Twist) -> MissionVerdict | None:
        """Return the verdict once the finished robot stands still, or after _SETTLE_TIME."""
        if self.finished_at is None:
            self.finished_at = now
        moving = abs(twist.v) > _STILL or abs(twist.w) > _STILL
        if moving and now - self.finished_at < _SETTLE_TIME:
            return None
        missed = self.goal_checker.missed(pose)
        if missed is None:
            goal = self.task.goals[-1]
            off = math.hypot(goal.x - pose.x, goal.y - pose.y)
            return self._end(Outcome.REACHED, f"stopped {off:.2f} m from {goal_name(goal)}")
        return self._end(Outcome.LOST, missed)

    def _fault(self, kind: Cause, reason: str, trace: str = "") -> MissionVerdict:
        return replace(self._end(Outcome.FAULT, reason), fault=kind, trace=trace)

    def _end(self, outcome: Outcome, reason: str) -> MissionVerdict:
        trouble = self.pilot.state.sight.trouble
        if trouble and outcome in (Outcome.STUCK, Outcome.TIMEOUT):
            reason = f"{reason}; {trouble}"
        return MissionVerdict(
            outcome=outcome,
            reason=reason,
            behavior=self.last_leader,
            tick=self.logger.ticks,
            time=self.simulator.time,
        )
