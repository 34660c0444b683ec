"""Worlds, drives and poses that the tests of the simulator share."""

import math
import zlib
from pathlib import Path

import numpy as np

from navfw.config import find
from navfw.signals import Frame, Pose, SensorReading
from navfw.sim import SceneGeometry, SensorParams, Simulation, WorldSpec, load_world
from navfw.worldgen import generate
from navfw.worldgen.generation import FAMILIES

PERFECT = SensorParams.preset("perfect")
TICK = 1.0 / 60.0
"""One control period [s]."""


def drive(
    sim: Simulation, seconds: float, left: float, right: float, until_contact: bool = False
) -> list[SensorReading]:
    """The readings at the control rate while the wheels turn with these speeds [rad/s]."""
    readings = []
    for _ in range(round(seconds / TICK)):
        readings.append(sim.read())
        sim.drive(left, right)
        sim.advance(TICK)
        if until_contact and sim.contacts:
            break
    return readings


def frames(readings: list[SensorReading]) -> list[Frame]:
    return [reading.frame for reading in readings if reading.frame is not None]


def loaded(folder: Path, text: str) -> WorldSpec:
    """The world of a file with this text."""
    path = folder / "world.yaml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)


def world_of(name: str, seed: int) -> WorldSpec:
    """A generated world of that family, or the shipped one of that name."""
    return generate(name, seed, 0.6).world if name in FAMILIES else load_world(find("world", name))


def free_poses(world: WorldSpec, count: int, seed: int = 0) -> list[Pose]:
    """Random poses at least 0.25 m from all solids."""
    rng = np.random.default_rng([zlib.crc32(world.name.encode()), seed])
    plan = SceneGeometry.from_world(world)
    x0, y0, x1, y1 = plan.bounds
    poses: list[Pose] = []
    while len(poses) < count:
        x, y = rng.uniform(x0, x1), rng.uniform(y0, y1)
        if plan.clearance(x, y) > 0.25:
            poses.append(Pose(x, y, rng.uniform(-math.pi, math.pi)))
    return poses
