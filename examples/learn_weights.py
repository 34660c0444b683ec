"""Learn the weights of the behaviours with CMA-ES, and compare them with the shipped composite.

A policy is one constant weight for each behaviour, in the place of the composite ``travel``, whose
rules weigh by the situation. CMA-ES (the package cma, BSD licence) maximises the mean return over
training seeds; the result is driven on held-out seeds beside the untrained ones::

    uv run python examples/learn_weights.py --family clutter

docs/gym.md has figures.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean

import cma
import cv2
import numpy as np

from navfw import run_generated
from navfw.gym import MissionEnv

DIFFICULTY = (0.0, 1.0)
"""Range that the seed draws the difficulty of its world from, as in the shipped suites."""


@dataclass(frozen=True)
class Drive:
    """One run: its return where the environment gives one, success, SPL."""

    reward: float
    succeeded: bool
    spl: float


@cache
def environment(family: str) -> MissionEnv:
    """One environment a process; what it observes is not used."""
    cv2.setNumThreads(1)
    return MissionEnv(family=family, difficulty=DIFFICULTY, action="weights", observation="flow")


def drive(family: str, job: tuple[Sequence[float], int]) -> Drive:
    """Drive with constant weights in the world of a seed."""
    weights, seed = job
    env = environment(family)
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
    return Drive(0.0, result.outcome.succeeded, result.metrics.spl)


def learn(pool: ProcessPoolExecutor, options: argparse.Namespace, count: int) -> list[float]:
    """The mean of the search distribution at the end; it starts at 0.8 for all."""
    search = cma.CMAEvolutionStrategy(
        count * [0.8],
        0.25,
        {"bounds": [0.0, 1.0], "popsize": options.population, "seed": 1, "verbose": -9},
    )
    seeds = seeds_of(options.train)
    for generation in range(options.generations):
        asked = [list(map(float, candidate)) for candidate in search.ask()]
        jobs = [(candidate, seed) for candidate in asked for seed in seeds]
        drives = list(pool.map(partial(drive, options.family), jobs))
        returns = [
            fmean(d.reward for d in drives[i : i + len(seeds)])
            for i in range(0, len(drives), len(seeds))
        ]
        search.tell(asked, [-value for value in returns])
        print(f"generation {generation}: mean {fmean(returns):.2f}, best {max(returns):.2f}")
    return [float(weight) for weight in search.result.xfavorite]


def seeds_of(text: str) -> range:
    """The seeds from A to B - 1 of ``A:B``."""
    first, end = map(int, text.split(":"))
    return range(first, end)


def shown(drives: Sequence[Drive]) -> dict[str, float]:
    """Successes and mean SPL."""
    return {
        "runs": len(drives),
        "reached": sum(d.succeeded for d in drives),
        "spl": round(fmean(d.spl for d in drives), 3),
    }


def main() -> None:
    """Learn, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--family", default="clutter")
    parser.add_argument("--train", default="0:4", help="training seeds, A:B")
    parser.add_argument("--test", default="1000:1012", help="held-out seeds, A:B")
    parser.add_argument("--generations", type=int, default=8)
    parser.add_argument("--population", type=int, default=8)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, help="file for the result, JSON")
    options = parser.parse_args()
    names = list(weighed_behaviors(options.family))
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        learnt = learn(pool, options, len(names))
        seeds = seeds_of(options.test)
        equal = len(names) * [1.0]
        policies = {"all weights 1": equal, "learnt": learnt}
        result = {
            name: shown(list(pool.map(partial(drive, options.family), [(w, s) for s in seeds])))
            for name, w in policies.items()
        }
        result["travel"] = shown(list(pool.map(partial(drive_shipped, options.family), seeds)))
    weights = {name: round(w, 2) for name, w in zip(names, learnt, strict=True)}
    text = json.dumps({"weights": weights, "held out": result}, indent=2)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n", encoding="utf-8")


def weighed_behaviors(family: str) -> tuple[str, ...]:
    """The behaviours that are weighed."""
    env = environment(family)
    env.reset(seed=0)
    names = env.behaviors
    env.close()
    return names


if __name__ == "__main__":
    main()
