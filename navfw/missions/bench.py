"""What the loop costs: its wall time against that of rendering and physics alone."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from navfw.missions.runner import run_task
from navfw.missions.session import Session

__all__ = ["Lap", "bench_loop", "one_core", "peak_memory_mb", "summarize"]

WARM_UP = 2.0
"""Simulated time [s] driven beforehand: compiling kernels is not the loop's cost."""


@dataclass(frozen=True, slots=True)
class Lap:
    """One repeat: simulated time and wall times [s], and computing time by stage [s]."""

    sim_time: float
    wall_time: float
    render_time: float
    stages: dict[str, float]
    outcome: str

    @property
    def ratio(self) -> float:
        """The whole loop against rendering and physics alone."""
        return self.wall_time / self.render_time


def bench_loop(
    session: Session, seconds: float, repeats: int, tick: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Drive the first ``seconds`` [s] of a mission ``repeats`` times on one core.

    ``tick`` is told what is going on. See ``summarize`` for what comes back.
    """
    say = tick or (lambda _: None)
    with one_core() as pinned:
        say("warming up")
        _lap(session, min(WARM_UP, seconds))
        laps = []
        for number in range(1, repeats + 1):
            say(f"lap {number} of {repeats}")
            laps.append(_lap(session, seconds))
    return {
        "world": session.world_name,
        "mission": session.mission_name,
        "seed": session.seed,
        **summarize(laps, session.mission.spec.robot.camera.rate),
        "one_core": pinned,
        "peak_memory_mb": peak_memory_mb(),
    }


def _lap(session: Session, seconds: float) -> Lap:
    task = replace(session.task, timeout=seconds)
    with session.simulation() as simulator:
        before = simulator.timings.render + simulator.timings.physics
        run = run_task(task, session.stack, simulator)
        spent = simulator.timings
    return Lap(
        sim_time=run.sim_time,
        wall_time=run.wall_time,
        render_time=spent.render + spent.physics - before,
        stages={
            "render": spent.render,
            "physics": spent.physics,
            "sensors": spent.sensors,
            **session.stack.timings,
        },
        outcome=str(run.verdict.outcome),
    )


def summarize(laps: Sequence[Lap], frame_rate: float) -> dict[str, Any]:
    """Medians over the laps, with the extremes under ``spread``; stages in ms per camera frame."""

    def frames(lap: Lap) -> float:
        return max(1.0, lap.sim_time * frame_rate)

    ratios = [lap.ratio for lap in laps]
    speeds = [lap.sim_time / lap.wall_time for lap in laps]
    names = list(laps[0].stages)
    return {
        "outcome": laps[-1].outcome,
        "repeats": len(laps),
        "sim_time_s": median(lap.sim_time for lap in laps),
        "loop_wall_s": median(lap.wall_time for lap in laps),
        "render_physics_wall_s": median(lap.render_time for lap in laps),
        "loop_over_render": median(ratios),
        "real_time_factor": median(speeds),
        "stage_ms": {
            name: median(1e3 * lap.stages[name] / frames(lap) for lap in laps) for name in names
        },
        "spread": {
            "loop_over_render": [min(ratios), max(ratios)],
            "real_time_factor": [min(speeds), max(speeds)],
        },
    }


@contextlib.contextmanager
def one_core() -> Iterator[bool]:
    """Inside, this process stays on one core, where the system can say so; gives whether it can."""
    if not hasattr(os, "sched_setaffinity"):
        yield False
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield True
    finally:
        os.sched_setaffinity(0, allowed)


def peak_memory_mb() -> float | None:
    """The most memory [MB] this process has had resident; None where that cannot be told."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
