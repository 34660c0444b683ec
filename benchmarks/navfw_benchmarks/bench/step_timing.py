"""Processor time of steps and resets of environments, with and without drawing."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from statistics import median
from typing import Any

import numpy as np

from navfw.gym.agent_spaces import Observation
from navfw.gym.mission_env import MissionEnv
from navfw.process.result_table import Column, ResultTable
from navfw.process.work_progress import ProgressCallback, silent, with_progress

_SEED = 1000
"""Seed of the timed episodes."""
_OBSERVATIONS: tuple[Observation, ...] = ("percept", "local_map")
_MODES: dict[str, Any] = {"undrawn": {"drawn": False}, "coarse": {"coarse": True}, "full": {}}


def bench_gym(
    family: str = "rooms", steps: int = 200, repeats: int = 5, report: ProgressCallback = silent
) -> dict[str, Any]:
    """Time ``repeats`` runs of ``steps`` steps in one world of ``family``, for six environments.

    The action is a twist toward the waypoint. ``steps_per_s`` of processor time, and ``reset_ms``
    of a reset in the same world: median, least and largest. All threads of the process count, of
    which OpenCV has one.

    Raises:
        InputError: there is no such family.

    """
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    environments, kinds = {}, list(product(_MODES, _OBSERVATIONS))
    for mode, observation in with_progress(kinds, "environments", report):
        env = MissionEnv(family=family, observation=observation, **_MODES[mode])
        _timed(env, steps)  # compiles and fills caches
        rates, resets = zip(*(_timed(env, steps) for _ in range(repeats)), strict=True)
        env.close()
        figures = {"steps_per_s": _spread(rates), "reset_ms": _spread(resets)}
        environments[f"{mode}-{observation}"] = figures
    cv2.setNumThreads(threads)
    return {"family": family, "steps": steps, "repeats": repeats, "environments": environments}


def _timed(env: MissionEnv, steps: int) -> tuple[float, float]:
    """Steps in a second of processor time, without resets; time of the first reset [ms]."""
    began = time.process_time()
    seen, _ = env.reset(seed=_SEED)
    reset, spent = 1e3 * (time.process_time() - began), 0.0
    for _ in range(steps):
        ahead, left = (float(value) for value in seen["waypoint"])
        action = np.array([float(ahead > 0.0), np.clip(0.5 * left, -1.0, 1.0)], np.float32)
        began = time.process_time()
        seen, _, terminated, truncated, _ = env.step(action)
        spent += time.process_time() - began
        if terminated or truncated:
            seen, _ = env.reset(seed=_SEED)
    return steps / spent, reset


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"median": median(values), "min": min(values), "max": max(values)}


def _cell(key: str, record: Mapping[str, Any]) -> str:
    """Median, and the least to the largest."""
    return "{median:.0f} ({min:.0f} to {max:.0f})".format(**record[key])


def tables(result: Mapping[str, Any]) -> Iterator[ResultTable]:
    """Steps a second and the time of a reset, of each environment."""
    columns = [Column("environment", "name")]
    for title, key in (("steps/s", "steps_per_s"), ("reset [ms]", "reset_ms")):
        columns.append(Column(title, partial(_cell, key)))
    records = [{"name": name, **figures} for name, figures in result["environments"].items()]
    yield ResultTable("environments, one core", columns, records)
