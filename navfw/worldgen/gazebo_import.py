"""Imports Gazebo worlds of cylinders, boxes and meshes, with a mission; also BARN benchmark worlds.

BARN (Perille et al. 2020; github.com/Daffan/the-barn-challenge): its mission leads from (-2.25, 3)
facing y to (-2.25, 13), reached within 1 m, in 100 s. Each ``world_N.world`` has a reference path
``path_N.npy``, cells of a grid that do not depend on the robot; the score is relative to it.
"""

from __future__ import annotations

import io
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import read_array

from navfw.assumption import Assumption
from navfw.config.input_file import is_file, read_input, shown_path
from navfw.config.yamlfile import rewording
from navfw.errors import ConfigError, InputError, WorldError
from navfw.missions.missionfile import goals_map
from navfw.missions.missionspec import MissionSpec
from navfw.numerics import Array
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.shapes import Circle, Rectangle, Shape
from navfw.sim.upright_parts import UprightPart
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import BoxSpec, CylinderSpec, WorldSpec
from navfw.worldgen.looks import Palette
from navfw.worldgen.sdf_reader import SdfWorld, read_sdf
from navfw.worldgen.world_draft import FAST_ROBOT, MISSION, POLES_STACK, ROBOT, MadeWorld

POLE_HEIGHT = 1.0
"""Height of BARN's poles [m]: in the files, half of their 1 m is below the ground."""

_BARN_START = (-2.25, 3.0, 1.57)
_BARN_GOAL = (-2.25, 13.0)
"""Start (x, y [m], yaw [rad]) and goal (x, y [m]) of BARN's mission."""

_RADIUS = 0.075
"""Radius of BARN's poles [m], half the side of a cell."""
_ORIGIN = -_RADIUS - 30 * 2 * _RADIUS, _RADIUS + 5.0
"""x and y [m] of the cell (0, 0) of reference paths."""


def _is_barn(content: SdfWorld) -> bool:
    """Whether this is a world of the BARN benchmark: many cylinders of BARN's name and radius."""
    return len(content.shapes) >= 20 and all(
        solid.name.startswith("unit_cylinder")
        and isinstance(solid.shape, Circle)
        and abs(solid.shape.radius - _RADIUS) < 1e-6
        for solid in content.shapes
    )


def reference_length(world_file: Path) -> float | None:
    """Return the reference path's length [m] beside ``world_N.world``, with start and goal.

    None if there is no file ``path_N.npy``.

    Raises:
        ConfigError: the file is not an array of finite cells.

    """
    number = re.fullmatch(r"world_(\d+)", world_file.stem)
    path = world_file.with_name(f"path_{number[1]}.npy") if number else None
    if path is None or not is_file(path):
        return None
    points = np.array([_BARN_START[:2], *(_cells(path) * 2 * _RADIUS + _ORIGIN), _BARN_GOAL])
    return round(float(np.hypot(*np.diff(points, axis=0).T).sum()), 3)


def _cells(path: Path) -> Array:
    """(n, 2) cells of a reference path."""
    try:
        cells = read_array(io.BytesIO(read_input(path)), allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise ConfigError(f"is no NumPy array: {error}", file=path) from None
    is_path = cells.ndim == 2 and cells.shape[1] == 2 and cells.dtype.kind in "iuf"
    if not is_path or not np.isfinite(cells).all():
        what = f"expected finite cells (n, 2) of a path, got {cells.dtype} {cells.shape}"
        raise ConfigError(what, file=path)
    return np.asarray(cells, dtype=np.float64)


Goal = tuple[float, float]
Start = tuple[float, float, float]

_BORDER = 3.0
"""Width of the floor around all solids, start and goal [m]."""
_MAX_LISTED = 20
"""Largest number of unsupported elements that are listed."""
_MAX_STEP = 0.3
"""Largest height [m] of a slab that counts as floor."""
_MIN_HEIGHT = 0.02 - 1e-9
"""Smallest height of a solid above the floor [m], with a margin for rounding."""


@dataclass(frozen=True, kw_only=True)
class ImportedWorld(MadeWorld):
    """The world of an SDF file, the elements ``skipped``, and what was ``assumed``.

    ``shortest`` [m] is the length of the shortest path for the default robot, ``meshes`` the number
    of meshes that became boxes and cylinders.
    """

    shortest: float
    skipped: tuple[str, ...]
    assumed: tuple[Assumption, ...]
    barn: bool
    meshes: int


def import_world(
    path: str | Path,
    *,
    start: Start | None = None,
    goal: Goal | None = None,
    skip_unsupported: bool = False,
    models: Path | None = None,
) -> ImportedWorld:
    """Import an SDF world; ``start`` (x, y, yaw) and ``goal`` default to BARN's in BARN worlds.

    ``SdfFiles`` says where models and meshes are looked up, besides the folder ``models``.

    Raises:
        ConfigError: the file is not an SDF world.
        InputError: it has unsupported elements (``skip_unsupported`` leaves them out), or start
            or goal is not given.
        WorldError: start or goal is not free, or there is no path between them.

    """
    path = Path(path)
    content = read_sdf(path, models)
    if content.unsupported and not skip_unsupported:
        raise _unsupported(path, content)
    barn = _is_barn(content)
    if barn:
        start, goal = start or _BARN_START, goal or _BARN_GOAL
    if start is None or goal is None:
        missing = ["--start"] * (start is None) + ["--goal"] * (goal is None)
        what = f"has no start and goal of its own: give {' and '.join(missing)}"
        raise InputError(what, file=path)
    _stand_on_floor(content, [start[:2], goal])
    with rewording("is out of range: ", file=path):
        world = _world(path, content, barn, [start[:2], goal])
    check_world(world, file=path)
    return ImportedWorld(
        world=world,
        missions={MISSION: _mission(path, start, goal, barn)},
        topo_map=goals_map([start[:2], goal]),
        shortest=_shortest_path(path, world, start, goal),
        skipped=tuple(content.unsupported),
        assumed=tuple(content.assumed),
        barn=barn,
        meshes=content.meshes,
    )


def _unsupported(path: Path, content: SdfWorld) -> InputError:
    """Return the error that lists the unsupported elements, and says where files were looked up."""
    lines = content.unsupported[:_MAX_LISTED]
    more = len(content.unsupported) - len(lines)
    what = "\n  ".join(("has unsupported elements:", *lines, *[f"{more} more"] * (more > 0)))
    if any("not found" in line for line in lines):
        looked = ", ".join(dict.fromkeys(map(shown_path, content.folders)))
        what += f"\nlooked in {looked}; name the folder that has the models with --models or"
        what += " GAZEBO_MODEL_PATH (gz fuel download -u URL gets those of an address)"
    return InputError(f"{what}\n--skip-unsupported leaves them out", file=path)


def _stand_on_floor(content: SdfWorld, ends: Sequence[Goal]) -> None:
    """Lower the world by the height of the slab on which both ``ends`` are, if there is one."""
    slabs = [s for s in content.shapes if s.bottom < _MAX_STEP and 0.0 < s.top <= _MAX_STEP]
    inside = [[s for s in slabs if s.shape.distance(np.array([end]))[0] < 0.0] for end in ends]
    first, last = (max(below, key=lambda solid: solid.top, default=None) for below in inside)
    if first is None or last is None or abs(first.top - last.top) > _MIN_HEIGHT:
        return
    content.shapes = [
        replace(s, bottom=s.bottom - first.top, top=s.top - first.top) for s in content.shapes
    ]
    reason = f"start and goal are on {first.name!r}"
    content.assumed.append(Assumption("floor", f"at z = {first.top:.3g} m", reason))


def _world(path: Path, content: SdfWorld, barn: bool, ends: Sequence[Goal]) -> WorldSpec:
    """Return the world with all shapes that extend above the ground."""
    palette = Palette(np.random.default_rng(zlib.crc32(path.stem.encode())))
    floor, textures = palette.draw("floor"), palette.draw_many("thing", 4)
    levels = [(0.0, POLE_HEIGHT) if barn else (max(s.bottom, 0.0), s.top) for s in content.shapes]
    # a thin board in the air is as thick as a solid may be, what lies on the floor is left out
    levels = [(low, max(high, low + 0.02 * (low > 0.02))) for low, high in levels]
    standing = [
        (solid, low, high)
        for solid, (low, high) in zip(content.shapes, levels, strict=True)
        if high - low > _MIN_HEIGHT
    ]
    # all parts of a mesh look alike
    of_meshes = [palette.pick(textures) for _ in range(content.meshes)]

    def common(solid: UprightPart, base: float) -> dict[str, Any]:
        return {
            "name": solid.name,
            "at": (round(solid.shape.x, 4), round(solid.shape.y, 4)),
            "base": round(base, 4),
            "texture": of_meshes[solid.mesh - 1] if solid.mesh else palette.pick(textures),
        }

    boxes = tuple(
        BoxSpec(
            **common(s, low),
            size=(round(2 * s.shape.half_x, 4), round(2 * s.shape.half_y, 4), round(high - low, 4)),
            yaw=round(s.shape.yaw, 5),
        )
        for s, low, high in standing
        if isinstance(s.shape, Rectangle)
    )
    cylinders = tuple(
        CylinderSpec(**common(s, low), radius=round(s.shape.radius, 4), height=round(high - low, 4))
        for s, low, high in standing
        if isinstance(s.shape, Circle)
    )
    x, y = _bounds([s.shape for s, _, _ in standing], ends)
    return WorldSpec(
        name=path.stem[:60] or "imported",
        description=_description(path, len(boxes), len(cylinders), content.meshes, barn),
        x=x,
        y=y,
        floor=floor,
        boxes=boxes,
        cylinders=cylinders,
        textures=palette.textures,
        may_overlap=True,
    )


def _description(path: Path, boxes: int, cylinders: int, meshes: int, barn: bool) -> str:
    parts = [
        f"{count} {what}" for count, what in ((cylinders, "cylinders"), (boxes, "boxes")) if count
    ]
    added = "procedural textures, light, and a floor that ends 3 m beyond everything"
    what = "a Gazebo world"
    if barn:
        what, added = "a BARN world", f"the poles' height of {POLE_HEIGHT:g} m, {added}"
    if meshes:
        what += f" (with the upright parts of {'a mesh' if meshes == 1 else f'{meshes} meshes'})"
    return f"{' and '.join(parts) or 'Nothing'} from {path.name}, {what}. Added: {added}."


def _bounds(
    shapes: Sequence[Shape], ends: Sequence[Goal]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the floor's x and y [m]."""
    points = np.array([(s.x, s.y) for s in shapes] + list(ends))
    reach = np.array([s.reach for s in shapes] + [0.0] * len(ends))[:, None]
    low = (points - reach).min(axis=0) - _BORDER
    high = (points + reach).max(axis=0) + _BORDER
    x, y = np.stack([low, high], axis=1).tolist()
    return (round(x[0], 3), round(x[1], 3)), (round(y[0], 3), round(y[1], 3))


def _mission(path: Path, start: Start, goal: Goal, barn: bool) -> MissionSpec:
    data: dict[str, object] = {
        "description": f"Cross {path.stem}.",
        "start": start,
        "goals": [{"x": goal[0], "y": goal[1]}],
        "timeout": 100.0 if barn else 180.0,
    }
    if barn:
        data |= {
            "tolerance": 0.8,
            "success": {"within": 1.0, "reference": reference_length(path)},
            "robot": FAST_ROBOT,
            "stack": POLES_STACK,
        }
    with rewording("start or goal is out of range: "):
        return MissionSpec.model_validate(data)


def _shortest_path(path: Path, world: WorldSpec, start: Start, goal: Goal) -> float:
    """Return the length of the shortest path of the default robot [m]."""
    plan = SceneGeometry.from_world(world, ROBOT.height)
    try:
        return plan.shortest_path(start[:2], goal, ROBOT.radius)[0]
    except WorldError as error:
        raise WorldError(f"{error} (--start and --goal choose others)", file=path) from None
