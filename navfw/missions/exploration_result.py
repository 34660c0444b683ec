"""Evaluates an exploration: how much of the reachable floor was observed, and why not the rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import cv2
import numpy as np

from navfw.localmap.cell_arrays import without_gaps
from navfw.missions.true_tour import TrueTour
from navfw.numerics import Array, Mask
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Pose
from navfw.sim.scene_geometry import ConfigurationSpaceGrid, SceneGeometry
from navfw.sim.world_changes import WalkerTrack

_POINT_RADIUS = 0.03
"""Radius [m] of a nearly point-shaped robot, to tell narrow passages from closed ones."""
_LEFT_AREA = 0.25
"""Least area [m^2] of an unobserved region that is listed."""
_BESIDE = 1.0
"""Largest distance [m] from an unobserved region of the walker or frontier that explains it."""
_STAYED = 0.2
"""Smallest share of the run that a walker is beside a region for it to be the explanation."""


@dataclass(frozen=True, slots=True)
class UnexploredRegion:
    """A region of floor that was not observed: a point x, y [m, ``map``] in it, ``area`` [m^2]."""

    x: float
    y: float
    area: float
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationResult:
    """The outcome of an exploration, over the ``reachable_m2`` of floor that the robot can cover.

    ``observed_share`` is the share of that floor that was observed, ``tour_m`` the length of the
    nearest-frontier tour on the true map (``TrueTour``), ``path_over_tour`` the driven length
    divided by it. ``returned``: the robot truly stands at its start. ``unexplored`` is sorted by
    area, largest first.
    """

    observed_share: float
    reachable_m2: float
    returned: bool
    tour_m: float
    path_over_tour: float
    unexplored: tuple[UnexploredRegion, ...] = field(default=())

    def as_data(self) -> dict[str, Any]:
        """Plain data for ``result.json``."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class ReachableFloor:
    """The floor of a true plan that a body can reach: masks (rows, columns) of cells of ``grid``.

    ``floor`` is what the body covers at all poses that it can reach. ``beyond`` would be covered
    only by a smaller body, ``shut`` only with all doors open.
    """

    grid: ConfigurationSpaceGrid
    floor: Mask
    beyond: Mask
    shut: Mask

    @classmethod
    def of(
        cls, plan: SceneGeometry, passable: SceneGeometry, robot: RobotModel, start: Pose
    ) -> ReachableFloor:
        """Compute the floor of ``plan`` for ``robot`` from ``start``; ``passable``: doors open."""
        radius = robot.radius
        solid = plan.configuration_space(0.0)
        floor = _covered(plan, radius, start) & ~solid.occupied
        narrow = _covered(plan, _POINT_RADIUS, start) & ~solid.occupied
        opened = _covered(passable, radius, start) & ~solid.occupied
        return cls(solid, floor, narrow & ~floor, opened & ~floor & ~narrow)

    def unseen(self, grid: GrownGrid) -> Mask:
        """Mask (rows, columns) of the cells not shown by ``grid``; one-cell gaps count as shown."""
        known = without_gaps(~grid.unseen)
        rows, columns = np.indices(self.floor.shape).reshape(2, -1)
        cells = grid.cells_at(self.grid.centres(rows, columns))
        inside = np.all((cells >= 0) & (cells < known.shape), axis=1)
        seen = np.zeros(len(cells), np.bool_)
        seen[inside] = known[cells[inside, 0], cells[inside, 1]]
        return ~seen.reshape(self.floor.shape)


def measure_exploration(
    plans: tuple[SceneGeometry, SceneGeometry],
    robot: RobotModel,
    grid: GrownGrid,
    true: Array,
    *,
    within: float,
    back: bool,
    driven: float,
    given_up: Sequence[tuple[float, float, str]] = (),
    movers: WalkerTrack | None = None,
) -> ExplorationResult:
    """Compare the explored ``grid`` (``map``) with ``plans``: as it truly is, and with open doors.

    ``true`` (n, 3) are the true poses of the run, ``driven`` [m] its length; the robot has returned
    if it ends ``within`` [m] of its first pose. ``given_up`` are the planner's abandoned frontiers
    (x, y, reason). ``back``: the tour returns to the start.
    """
    plan, passable = plans
    start = Pose(*(float(value) for value in true[0]))
    ground = ReachableFloor.of(plan, passable, robot, start)
    unseen = ground.unseen(grid)
    count = int(np.count_nonzero(ground.floor))
    observed = np.count_nonzero(ground.floor & ~unseen) / max(count, 1)
    tour = TrueTour(ground.grid, robot, start).length(back=back)
    regions = [
        *_regions(ground.grid, ground.floor & unseen, _Explanation(given_up, movers)),
        *_regions(ground.grid, ground.beyond & unseen, "the passage is too narrow"),
        *_regions(ground.grid, ground.shut & unseen, "behind a closed door"),
    ]
    return ExplorationResult(
        observed_share=float(observed),
        reachable_m2=count * ground.grid.cell**2,
        returned=math.dist(true[-1, :2], true[0, :2]) <= within,
        tour_m=tour,
        path_over_tour=driven / tour if tour > 0.0 else 0.0,
        unexplored=tuple(sorted(regions, key=lambda region: -region.area)),
    )


def _covered(plan: SceneGeometry, radius: float, start: Pose) -> Mask:
    """Which cells (rows, columns) a body of ``radius`` [m] covers from where it gets to."""
    space = plan.configuration_space(radius)
    _, labels = cv2.connectedComponents((~space.occupied).view(np.uint8), connectivity=4)
    column, row = (
        min(max(int((at - first) / space.cell), 0), size - 1)
        for at, first, size in zip(
            (start.x, start.y), space.origin, space.occupied.shape[::-1], strict=True
        )
    )
    reached = (labels == labels[row, column]) & ~space.occupied
    side = 2 * round(radius / space.cell) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    covered: Mask = cv2.dilate(reached.view(np.uint8), disc) > 0
    return covered


class _Explanation:
    """Says why reachable floor was not observed."""

    def __init__(
        self, given_up: Sequence[tuple[float, float, str]], movers: WalkerTrack | None
    ) -> None:
        self._given_up, self._movers = given_up, movers

    def __call__(self, points: Array) -> str:
        """Why the floor at ``points`` (n, 2) [m] was not observed."""
        if self._movers is not None:
            x, y = points.mean(axis=0)
            near = np.hypot(*(self._movers.points - (x, y)).transpose(2, 0, 1)) <= _BESIDE
            if near.any(axis=1).mean() >= _STAYED:
                return "a walker in the way"
        for x, y, reason in self._given_up:
            if np.hypot(*(points - (x, y)).T).min() <= _BESIDE:
                return reason
        return "not looked at"


def _regions(
    grid: ConfigurationSpaceGrid, mask: Mask, why: str | _Explanation
) -> list[UnexploredRegion]:
    """Return the connected regions of ``mask`` of at least _LEFT_AREA."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    regions = []
    for number in range(1, len(stats)):
        area = float(stats[number, cv2.CC_STAT_AREA]) * grid.cell**2
        if area >= _LEFT_AREA:
            points = grid.centres(*np.nonzero(labels == number))
            x, y = points[int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
            reason = why if isinstance(why, str) else why(points)
            x, y, area = (round(float(value), 2) for value in (x, y, area))
            regions.append(UnexploredRegion(x, y, area, reason))
    return regions
