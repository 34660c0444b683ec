"""From a Gazebo world of cylinders and boxes to a world of ours, with a mission in it.

The BARN benchmark's worlds (Perille et al. 2020; github.com/Daffan/the-barn-challenge) bring their
mission along: from (-2.25, 3) facing y to (-2.25, 13), reached within 1 m, in 100 s.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from navfw.errors import InputError, WorldError
from navfw.missions.missionspec import MissionSpec
from navfw.sim.floorplan import FloorPlan
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import BoxSpec, CylinderSpec, WorldSpec
from navfw.worldgen.generated_world import write_world
from navfw.worldgen.sdf_reader import SdfShape, SdfWorld, read_sdf
from navfw.worldgen.texture_palette import Palette
from navfw.worldgen.world_draft import POLES, QUICK, ROBOT

__all__ = ["POLE_HEIGHT", "ImportedWorld", "import_world", "is_barn"]

Goal = tuple[float, float]
Start = tuple[float, float, float]

POLE_HEIGHT = 1.0
"""Height [m] given to BARN's poles: the files sink half of their 1 m into the ground."""

_BARN_RADIUS = 0.075
_BARN_START: Start = (-2.25, 3.0, 1.57)
_BARN_GOAL: Goal = (-2.25, 13.0)
_BORDER = 3.0
"""The floor ends so far [m] beyond everything."""


@dataclass(frozen=True)
class ImportedWorld:
    """A world and mission, the shortest way's length [m], and what was left out."""

    world: WorldSpec
    mission: MissionSpec
    shortest: float
    skipped: tuple[str, ...]
    barn: bool

    def write(self, folder: str | Path) -> Path:
        """Write ``world.yaml`` and ``missions/cross.yaml``; returns the folder.

        Raises:
            InputError: the folder cannot be written, or holds what was not written by this.

        """
        return write_world(folder, self.world, self.mission, None)


def is_barn(found: SdfWorld) -> bool:
    """Whether this is a world of the BARN benchmark, by its poles."""
    return len(found.shapes) >= 20 and all(
        shape.name.startswith("unit_cylinder") and abs(shape.radius - _BARN_RADIUS) < 1e-6
        for shape in found.shapes
    )


def import_world(
    path: str | Path,
    *,
    start: Start | None = None,
    goal: Goal | None = None,
    skip_unsupported: bool = False,
) -> ImportedWorld:
    """Import an SDF world; ``start`` (x, y, yaw) and ``goal`` are BARN's when it is one of BARN's.

    Raises:
        ConfigError: the file is no SDF world.
        InputError: it holds what is not supported (``skip_unsupported`` leaves that out), or start
            and goal are not given.
        WorldError: start or goal is not free, or no way leads from one to the other.

    """
    path = Path(path)
    found = read_sdf(path)
    if found.unsupported and not skip_unsupported:
        raise InputError(
            "holds what is not supported (static upright cylinders and boxes are):\n  "
            + "\n  ".join(found.unsupported)
            + "\n--skip-unsupported leaves it out",
            file=path,
        )
    barn = is_barn(found)
    start = start or (_BARN_START if barn else None)
    goal = goal or (_BARN_GOAL if barn else None)
    if start is None or goal is None:
        missing = " and ".join(
            option for option, at in (("--start", start), ("--goal", goal)) if at is None
        )
        raise InputError(f"does not say where to drive: give {missing}", file=path)
    try:
        world = _world(path, found, barn, [start[:2], goal])
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise InputError(f"cannot be: {first['msg']}", file=path, key=key) from None
    check_world(world, file=path)
    return ImportedWorld(
        world=world,
        mission=_mission(path, start, goal, barn),
        shortest=_passage(world, start, goal),
        skipped=tuple(found.unsupported),
        barn=barn,
    )


def _world(path: Path, found: SdfWorld, barn: bool, ends: Sequence[Goal]) -> WorldSpec:
    """The world with everything that stands on its floor."""
    palette = Palette(np.random.default_rng(zlib.crc32(path.stem.encode())))
    floor, textures = palette.draw("floor"), palette.draw_many("thing", 4)
    standing = [(s, *_levels(s, barn)) for s in found.shapes]
    standing = [(s, low, high) for s, low, high in standing if high - low >= 0.02]
    boxes = tuple(
        BoxSpec(
            name=s.name,
            at=(round(s.x, 4), round(s.y, 4)),
            size=(round(s.size[0], 4), round(s.size[1], 4), round(high - low, 4)),
            yaw=round(s.yaw, 5),
            base=round(low, 4),
            texture=palette.pick(textures),
        )
        for s, low, high in standing
        if not s.radius
    )
    cylinders = tuple(
        CylinderSpec(
            name=s.name,
            at=(round(s.x, 4), round(s.y, 4)),
            radius=round(s.radius, 4),
            height=round(high - low, 4),
            base=round(low, 4),
            texture=palette.pick(textures),
        )
        for s, low, high in standing
        if s.radius
    )
    x, y = _bounds([s for s, _, _ in standing], ends)
    return WorldSpec(
        name=path.stem[:60] or "imported",
        description=_description(path, len(boxes), len(cylinders), barn),
        x=x,
        y=y,
        floor=floor,
        boxes=boxes,
        cylinders=cylinders,
        textures=palette.textures,
        may_overlap=True,
    )


def _levels(shape: SdfShape, barn: bool) -> tuple[float, float]:
    """Underside and top [m] of what a shape shows above the floor."""
    if barn:
        return 0.0, POLE_HEIGHT
    return max(shape.z - 0.5 * shape.height, 0.0), shape.z + 0.5 * shape.height


def _description(path: Path, boxes: int, cylinders: int, barn: bool) -> str:
    parts = [
        f"{count} {what}" for count, what in ((cylinders, "cylinders"), (boxes, "boxes")) if count
    ]
    ours = "procedural textures, light, and a floor that ends 3 m beyond everything"
    if barn:
        ours = f"the poles' height of {POLE_HEIGHT:g} m, {ours}"
    what = "a BARN world" if barn else "a Gazebo world"
    return f"{' and '.join(parts) or 'Nothing'} from {path.name}, {what}. Ours: {ours}."


def _bounds(
    shapes: Sequence[SdfShape], ends: Sequence[Goal]
) -> tuple[tuple[float, float], tuple[float, float]]:
    reach = [s.radius or math.hypot(*s.size) / 2 for s in shapes] + [0.0] * len(ends)
    xs = [s.x for s in shapes] + [x for x, _ in ends]
    ys = [s.y for s in shapes] + [y for _, y in ends]
    low_x, low_y = (min(v - r for v, r in zip(at, reach, strict=True)) for at in (xs, ys))
    high_x, high_y = (max(v + r for v, r in zip(at, reach, strict=True)) for at in (xs, ys))
    return (
        (round(low_x - _BORDER, 3), round(high_x + _BORDER, 3)),
        (round(low_y - _BORDER, 3), round(high_y + _BORDER, 3)),
    )


def _mission(path: Path, start: Start, goal: Goal, barn: bool) -> MissionSpec:
    data: dict[str, object] = {
        "description": f"Cross {path.stem}.",
        "start": start,
        "goals": [{"x": goal[0], "y": goal[1]}],
        "timeout": 100.0 if barn else 180.0,
    }
    if barn:
        data |= {"tolerance": 0.8, "success": {"within": 1.0}, "robot": QUICK, "stack": POLES}
    try:
        return MissionSpec.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise InputError(f"start or goal cannot be: {first['msg']}", key=key) from None


def _passage(world: WorldSpec, start: Start, goal: Goal) -> float:
    """Length [m] of the shortest way for our robot."""
    plan = FloorPlan.from_world(world, ROBOT.height)
    try:
        return plan.shortest_path(start[:2], goal, ROBOT.radius)[0]
    except WorldError as error:
        raise WorldError(f"{error} (--start and --goal choose others)", file=world.name) from None
