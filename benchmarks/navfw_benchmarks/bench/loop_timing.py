"""Benchmark of the closed loop: its wall time relative to rendering and physics only.

The reference is PyBullet's own renderer, which is available to everybody. navfw's rasteriser draws
the same images faster, so the loop is compared with both.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np

from navfw.missions.runner import MissionLoop
from navfw.missions.session import Session
from navfw.process.process_resources import peak_memory_mb
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.recording.run_observers import RunLog
from navfw.signals import Pose
from navfw.sim.world_changes import WalkerTrack
from navfw_benchmarks.bench.reference_renderer import ReferenceRenderer

_WARM_UP = 2.0
"""Simulated time [s] driven before the first lap, so that laps contain no compiling of kernels."""

VIEWS = 40
"""Number of views of each lap, evenly spaced in time, that PyBullet renders as well."""

_WARM_UP_VIEWS = 3
"""Number of views rendered by PyBullet before its time is measured."""


@dataclass(frozen=True, slots=True)
class Lap:
    """One repetition: simulated time, wall times and computing time by stage [s].

    ``frames`` is the number of rendered frames, ``pybullet_frame`` [s] PyBullet's time for one.
    """

    sim_time: float
    wall_time: float
    render_time: float
    physics_time: float
    frames: int
    pybullet_frame: float
    stages: dict[str, float]
    outcome: str

    @property
    def reference_time(self) -> float:
        """PyBullet's rendering and physics [s]."""
        return self.frames * self.pybullet_frame + self.physics_time

    @property
    def ratio(self) -> float:
        """Wall time of the loop relative to PyBullet's rendering and physics."""
        return self.wall_time / self.reference_time

    @property
    def own_ratio(self) -> float:
        """Wall time of the loop relative to navfw's rendering and physics."""
        return self.wall_time / (self.render_time + self.physics_time)


def bench_loop(
    session: Session, seconds: float, repeats: int, report: ProgressCallback = silent
) -> dict[str, Any]:
    """Drive the first ``seconds`` [s] of a mission ``repeats`` times on one core.

    ``report`` is called with each lap. Returns ``summarize`` of the laps.
    """
    laps: list[Lap] = []
    spec = session.mission.spec
    with one_core() as pinned, contextlib.ExitStack() as opened:
        report("warming up")
        _drive(session, min(_WARM_UP, seconds))
        reference, memory = None, None
        for _ in with_progress(range(repeats), "laps", report):
            lap, log, movers = _drive(session, seconds)
            if reference is None:
                memory = peak_memory_mb()  # before PyBullet's renderer is loaded
                camera, sensors = spec.robot.camera, spec.sensors.resolved()
                renderer = ReferenceRenderer(session.world, camera, sensors.supersample)
                reference = opened.enter_context(renderer)
            # right after the lap: the speed of the machine changes over minutes
            frame = _pybullet_frame(log, movers, reference)
            laps.append(replace(lap, pybullet_frame=frame))
    return {
        "world": session.world_name,
        "mission": session.mission_name,
        "seed": session.seed,
        **summarize(laps, spec.robot.camera.rate),
        "one_core": pinned,
        "peak_memory_mb": memory,
    }


def _drive(session: Session, seconds: float) -> tuple[Lap, RunLog, WalkerTrack]:
    """A lap without PyBullet's frame time, and the poses of the robot and of the movers."""
    task = replace(session.task, timeout=seconds)
    with session.simulation() as simulator, session.stack.guard.watchdog.on_duty():
        before = replace(simulator.timings)
        run = MissionLoop(task, session.stack, simulator).run()
        spent = simulator.timings
        movers = simulator.walker_track()
    lap = Lap(
        sim_time=run.sim_time,
        wall_time=run.wall_time,
        render_time=spent.render - before.render,
        physics_time=spent.physics - before.physics,
        frames=spent.frames - before.frames,
        pybullet_frame=math.nan,
        stages={
            "render": spent.render,
            "physics": spent.physics,
            "sensors": spent.sensors,
            **session.stack.timings,
        },
        outcome=str(run.verdict.outcome),
    )
    return lap, run.log, movers


def _pybullet_frame(log: RunLog, movers: WalkerTrack, reference: ReferenceRenderer) -> float:
    """PyBullet's median wall time [s] for a frame of this drive.

    It draws only visible bodies, as the simulation does; hiding the others is not counted.
    """
    ticks = np.unique(np.linspace(0, log.ticks - 1, VIEWS).round().astype(int))
    times: list[float] = []
    for tick in ticks:
        if movers.names:
            places = movers.at(log.time[tick : tick + 1])[0]
            reference.place_walkers((float(x), float(y)) for x, y in places)
        request = reference.request(Pose(*log.true[tick].tolist()))
        if not times:
            for _ in range(_WARM_UP_VIEWS):
                reference.draw(request)
        times.append(reference.draw(request)[2])
    return median(times)


def summarize(laps: Sequence[Lap], frame_rate: float) -> dict[str, Any]:
    """Medians over the laps, with extremes under ``spread``; stages in ms per camera frame.

    ``loop_over_render`` compares with PyBullet's rendering and physics (``render_physics_wall_s``),
    ``loop_over_own_render`` with navfw's rendering and physics (``own_render_physics_wall_s``).
    """

    def frames(lap: Lap) -> float:
        return max(1.0, lap.sim_time * frame_rate)

    ratios = [lap.ratio for lap in laps]
    own_ratios = [lap.own_ratio for lap in laps]
    speeds = [lap.sim_time / lap.wall_time for lap in laps]
    names = list(laps[0].stages)
    return {
        "outcome": laps[-1].outcome,
        "repeats": len(laps),
        "sim_time_s": median(lap.sim_time for lap in laps),
        "loop_wall_s": median(lap.wall_time for lap in laps),
        "render_physics_wall_s": median(lap.reference_time for lap in laps),
        "own_render_physics_wall_s": median(lap.render_time + lap.physics_time for lap in laps),
        "pybullet_render_ms": median(1e3 * lap.pybullet_frame for lap in laps),
        "loop_over_render": median(ratios),
        "loop_over_own_render": median(own_ratios),
        "real_time_factor": median(speeds),
        "stage_ms": {
            name: median(1e3 * lap.stages[name] / frames(lap) for lap in laps) for name in names
        },
        "spread": {
            "loop_over_render": [min(ratios), max(ratios)],
            "loop_over_own_render": [min(own_ratios), max(own_ratios)],
            "real_time_factor": [min(speeds), max(speeds)],
        },
    }


@contextlib.contextmanager
def one_core() -> Iterator[bool]:
    """Pin this process to one core inside the context; yields False where that is not supported."""
    if not hasattr(os, "sched_setaffinity"):
        yield False
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield True
    finally:
        os.sched_setaffinity(0, allowed)
