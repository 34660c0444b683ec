"""Benchmark of the closed loop: its wall time relative to rendering and physics only.

The reference is PyBullet's own renderer, which is available to everybody. navfw's rasteriser draws
the same images faster, so the loop is compared with both.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

from navfw.missions.runner import MissionLoop
from navfw.missions.session import Session
from navfw.process.process_resources import peak_memory_mb
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent, with_progress
from navfw.recording.run_observers import RunLog
from navfw.signals import Pose
from navfw.sim.camera_rig import Timings
from navfw.sim.world_changes import WalkerTrack
from navfw_benchmarks.bench.reference_renderer import ReferenceRenderer

_WARM_UP = 2.0
"""Simulated time [s] driven before the first lap, so that laps contain no compiling of kernels."""

VIEWS = 40
"""Number of views of each lap, evenly spaced in time, that PyBullet renders as well."""

_WARM_UP_VIEWS = 3
"""Number of views rendered by PyBullet before its time is measured."""


_RATIOS = ("loop_over_render", "loop_over_own_render", "real_time_factor")
"""Figures whose extremes over the laps are given, too."""


def bench_loop(
    session: Session, seconds: float, repeats: int, report: ProgressCallback = silent
) -> dict[str, Any]:
    """Drive the first ``seconds`` [s] of a mission ``repeats`` times on one core.

    ``report`` is called with each lap. Returns medians over the laps, with the extremes of the
    ratios under ``spread``; ``stage_ms`` is computing time by stage and camera frame.
    """
    laps: list[dict[str, float]] = []
    stages: list[dict[str, float]] = []
    spec = session.mission.spec
    with one_core() as pinned, contextlib.ExitStack() as opened:
        report("warming up")
        _drive(session, min(_WARM_UP, seconds))
        reference, memory = None, None
        for _ in with_progress(range(repeats), "laps", report):
            run, spent, movers = _drive(session, seconds)
            if reference is None:
                memory = peak_memory_mb()  # before PyBullet's renderer is loaded
                camera, sensors = spec.robot.camera, spec.sensors.resolved()
                renderer = ReferenceRenderer(session.world, camera, sensors.supersample)
                reference = opened.enter_context(renderer)
            # right after the lap: the speed of the machine changes over minutes
            frame = _pybullet_frame(run.log, movers, reference)
            laps.append(_lap(run, spent, frame))
            own = {"render": spent.render, "physics": spent.physics, "sensors": spent.sensors}
            frames = max(1.0, run.sim_time * spec.robot.camera.rate)
            timed = own | session.stack.timings
            stages.append({name: 1e3 * timed[name] / frames for name in timed})
    return {
        "world": session.world_name,
        "mission": session.mission_name,
        "seed": session.seed,
        "outcome": str(run.verdict.outcome),
        "repeats": repeats,
        **_medians(laps),
        "stage_ms": _medians(stages),
        "spread": {name: [f(lap[name] for lap in laps) for f in (min, max)] for name in _RATIOS},
        "one_core": pinned,
        "peak_memory_mb": memory,
    }


def _drive(session: Session, seconds: float) -> tuple[MissionLoop, Timings, WalkerTrack]:
    """A lap: the run, the simulator's wall times [s], and the poses of the movers."""
    task = replace(session.task, timeout=seconds)
    with session.simulation() as simulator, session.stack.guard.watchdog.on_duty():
        run = MissionLoop(task, session.stack, simulator).run()
        return run, simulator.timings, simulator.walker_track()


def _lap(run: MissionLoop, spent: Timings, frame: float) -> dict[str, float]:
    """The figures of a lap; ``frame`` [s] is PyBullet's wall time for one of its frames.

    ``loop_over_render`` compares with PyBullet's rendering and physics (``render_physics_wall_s``),
    ``loop_over_own_render`` with navfw's rendering and physics (``own_render_physics_wall_s``).
    """
    pybullet, own = spent.frames * frame + spent.physics, spent.render + spent.physics
    return {
        "sim_time_s": run.sim_time,
        "loop_wall_s": run.wall_time,
        "render_physics_wall_s": pybullet,
        "own_render_physics_wall_s": own,
        "pybullet_render_ms": 1e3 * frame,
        "loop_over_render": run.wall_time / pybullet,
        "loop_over_own_render": run.wall_time / own,
        "real_time_factor": run.sim_time / run.wall_time,
    }


def _medians(laps: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {name: median(lap[name] for lap in laps) for name in laps[0]}


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


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """The medians, with the extremes of the ratios, and the computing time of each stage."""
    columns = [
        Column("", "name"),
        Column("median", "median", ".2f"),
        Column("least", "least", ".2f"),
        Column("most", "most", ".2f"),
    ]
    figures = []
    for name, value in result.items():
        if isinstance(value, float):
            least, most = result["spread"].get(name, (None, None))
            figures.append({"name": name, "median": value, "least": least, "most": most})
    yield ResultTable("the loop", columns, figures)
    stages = [{"name": name, "median": ms} for name, ms in result["stage_ms"].items()]
    yield ResultTable("computing time per camera frame [ms]", columns[:2], stages)


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
