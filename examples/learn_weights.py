"""Learn the weights of the behaviours with CMA-ES, and compare them with the shipped composite.

A policy is one constant weight for each behaviour, in the place of the composite ``travel``, whose
rules weigh by the situation. CMA-ES (the package cma, BSD licence) maximises the mean return
without drawing, over other worlds in every generation. The result is driven in held-out worlds,
with drawing and without, beside ``travel``; differences are of the same worlds, with their 95 %
intervals::

    uv run python examples/learn_weights.py --family hard --out weights.json

docs/gym.md has figures.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import cma
import cv2
import numpy as np
from scipy.stats import binomtest

from navfw import run_generated
from navfw.gym import MissionEnv

DIFFICULTY = (0.0, 1.0)
"""Range that the seed draws the difficulty of its world from, as in the shipped suites."""

START = {"follow_wall": 0.1, "centre_corridor": 0.3, "traverse_door": 0.5}
"""Weights that the search starts at, about those of ``travel`` on open floor; all others 0.8."""


@dataclass(frozen=True)
class Drive:
    """One run: its return (0 outside the environment), success, and SPL."""

    reward: float
    succeeded: bool
    spl: float


@cache
def environment(family: str, drawn: bool) -> MissionEnv:
    """Make the environment of this process, once; its observations are not used."""
    cv2.setNumThreads(1)
    kind = {"action": "weights", "observation": "flow", "drawn": drawn}
    return MissionEnv(family=family, difficulty=DIFFICULTY, **kind)


def drive(family: str, drawn: bool, weights: Sequence[float], seed: int) -> Drive:
    """Drive with constant weights in the world of a seed."""
    env = environment(family, drawn)
    env.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        _, reward, terminated, truncated, info = env.step(np.array(weights, np.float32))
        total, ended = total + reward, terminated or truncated
    return Drive(total, info["outcome"] == "reached", info["spl"])


def drive_shipped(family: str, seed: int) -> Drive:
    """Drive with the shipped composite in the world of a seed."""
    cv2.setNumThreads(1)
    result = run_generated(family, seed=seed, difficulty=DIFFICULTY)
    return Drive(0.0, result.outcome.succeeded, result.spl)


def learn(pool: ProcessPoolExecutor, options: argparse.Namespace) -> dict[str, float]:
    """Search by CMA-ES; return the mean of its distribution at the end: a weight by behaviour."""
    names = environment(options.family, False).behaviors
    start = [START.get(name, 0.8) for name in names]
    limits = {"bounds": [0.0, 1.0], "popsize": options.population, "seed": 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy(start, 0.25, limits)
    go = partial(drive, options.family, False)
    for generation in range(options.generations):
        first = generation * options.worlds
        seeds = range(first, first + options.worlds)
        asked = [list(map(float, candidate)) for candidate in search.ask()]
        # one world after the other: an environment keeps its last ones
        jobs = [(candidate, seed) for seed in seeds for candidate in asked]
        rewards = [made.reward for made in pool.map(go, *zip(*jobs, strict=True))]
        returns = np.reshape(rewards, (len(seeds), len(asked))).mean(axis=0)
        search.tell(asked, (-returns).tolist())
        print(f"generation {generation}: mean {returns.mean():.2f}, best {returns.max():.2f}")
    return dict(zip(names, map(float, search.result.xfavorite), strict=True))


def shown(drives: Sequence[Drive]) -> dict[str, Any]:
    """Summarise the drives: successes with Wilson's interval, and mean SPL."""
    reached = sum(made.succeeded for made in drives)
    low, high = binomtest(reached, len(drives)).proportion_ci(method="wilson")
    interval = [round(float(low), 3), round(float(high), 3)]
    spl = round(fmean(made.spl for made in drives), 3)
    return {"runs": len(drives), "reached": reached, "interval": interval, "spl": spl}


def difference(before: Sequence[Drive], after: Sequence[Drive]) -> dict[str, Any]:
    """Compare ``after`` with ``before`` in the same worlds: successes, SPL, 95 % intervals."""
    pairs = list(zip(before, after, strict=True))
    lost = sum(a.succeeded > b.succeeded for a, b in pairs)
    won = sum(b.succeeded > a.succeeded for a, b in pairs)
    spl = [b.spl - a.spl for a, b in pairs]
    mean, half = fmean(spl), 1.96 * stdev(spl) / math.sqrt(len(spl))
    # of two paired proportions: Bonett and Price 2012
    a, b = (lost + 1) / (len(pairs) + 2), (won + 1) / (len(pairs) + 2)
    wide = 1.96 * math.sqrt((a + b - (b - a) ** 2) / (len(pairs) + 2))
    rate = [round(b - a - wide, 3), round(b - a + wide, 3)]
    interval = [round(mean - half, 3), round(mean + half, 3)]
    return {"won": won, "lost": lost, "rate": rate, "spl": round(mean, 3), "spl_interval": interval}


def main() -> None:
    """Learn, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--family", default="hard")
    parser.add_argument("--generations", type=int, default=8)
    parser.add_argument("--population", type=int, default=10)
    parser.add_argument("--worlds", type=int, default=6, help="in each generation, from seed 0 on")
    parser.add_argument("--test", type=int, default=200, help="held-out worlds, from seed 2000 on")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--weights", type=Path, help="compare those of this file, without learning")
    parser.add_argument("--out", type=Path, help="file for the result, JSON")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        if options.weights is None:
            weights = learn(pool, options)
        else:
            weights = json.loads(options.weights.read_text(encoding="utf-8"))["weights"]
        result: dict[str, Any] = {"weights": {name: round(w, 2) for name, w in weights.items()}}
        learnt = [result["weights"][name] for name in environment(options.family, False).behaviors]
        print(json.dumps(result))
        policies: dict[str, Callable[[int], Drive]] = {
            "learnt": partial(drive, options.family, True, learnt),
            "travel": partial(drive_shipped, options.family),
            "learnt, not drawn": partial(drive, options.family, False, learnt),
        }
        seeds = range(2000, 2000 + options.test)
        driven = {name: list(pool.map(go, seeds)) for name, go in policies.items()}
    result |= {name: shown(drives) for name, drives in driven.items()}
    for name in ("travel", "learnt, not drawn"):
        result[f"learnt minus {name}"] = difference(driven[name], driven["learnt"])
    text = json.dumps(result, indent=2)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
