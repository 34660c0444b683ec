"""Evaluates an exploration: how much of the reachable floor was observed, and why not the rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from navfw.localmap.cell_arrays import without_gaps
from navfw.missions.run_metrics import (
    SAMPLING,
    ExplorationResult,
    UnexploredRegion,
    path_length,
)
from navfw.missions.true_tour import TrueTour
from navfw.numerics import Array, Mask
from navfw.recording.run_observers import RunLog
from navfw.robot import RobotModel
from navfw.signals import GrownGrid, Pose
from navfw.sim.scene_geometry import ConfigurationSpaceGrid, SceneGeometry
from navfw.sim.world_changes import WalkerTrack

Session = Any
"""Stands for ``navfw.missions.session.Session``, whose module imports this one."""

_POINT_RADIUS = 0.03
"""Radius [m] of a nearly point-shaped robot, to tell narrow passages from closed ones."""
_LEFT_AREA = 0.25
"""Least area [m^2] of an unobserved region that is listed."""
_BESIDE = 1.0
"""Largest distance [m] from an unobserved region of the walker or frontier that explains it."""
_STAYED = 0.2
"""Smallest share of the run that a walker is beside a region for it to be the explanation."""


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
    session: Session, log: RunLog, movers: WalkerTrack | None
) -> ExplorationResult | None:
    """Compare what an exploration observed with the plan as it truly is, and with open doors.

    None for another mission, or before the first tick.
    """
    spec, growing = session.mission.spec, session.stack.growth.growing_map
    if spec.explore is None or not log.ticks:
        return None
    growing.finish()
    if not growing.keys:
        return None
    true, robot = log.true, spec.robot
    start = Pose(*(float(value) for value in true[0]))
    ground = ReachableFloor.of(session.plan, session.passable, robot, start)
    unseen = ground.unseen(growing.grid)
    count = int(np.count_nonzero(ground.floor))
    observed = np.count_nonzero(ground.floor & ~unseen) / max(count, 1)
    tour = TrueTour(ground.grid, robot, start).length(back=spec.explore.return_home)
    given_up = session.stack.planner.explain_choice().get("given_up", ())

    def why(points: Array) -> str:
        """Why reachable floor at ``points`` (n, 2) [m] was not observed."""
        if movers is not None:
            x, y = points.mean(axis=0)
            near = np.hypot(*(movers.points - (x, y)).transpose(2, 0, 1)) <= _BESIDE
            if near.any(axis=1).mean() >= _STAYED:
                return "a walker in the way"
        for left in given_up:
            if np.hypot(*(points - (left["x"], left["y"])).T).min() <= _BESIDE:
                return str(left["why"])
        return "not looked at"

    regions = [
        *_regions(ground.grid, ground.floor & unseen, why),
        *_regions(ground.grid, ground.beyond & unseen, lambda _: "the passage is too narrow"),
        *_regions(ground.grid, ground.shut & unseen, lambda _: "behind a closed door"),
    ]
    return ExplorationResult(
        observed_share=float(observed),
        reachable_m2=count * ground.grid.cell**2,
        returned=math.dist(true[-1, :2], true[0, :2]) <= session.success_radius,
        tour_m=tour,
        path_over_tour=path_length(true[log.every(SAMPLING)]) / tour if tour > 0.0 else 0.0,
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


def _regions(
    grid: ConfigurationSpaceGrid, mask: Mask, why: Callable[[Array], str]
) -> list[UnexploredRegion]:
    """Return the connected regions of ``mask`` of at least _LEFT_AREA."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    regions = []
    for number in range(1, len(stats)):
        area = float(stats[number, cv2.CC_STAT_AREA]) * grid.cell**2
        if area >= _LEFT_AREA:
            points = grid.centres(*np.nonzero(labels == number))
            x, y = points[int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
            x, y, area = (round(float(value), 2) for value in (x, y, area))
            regions.append(UnexploredRegion(x, y, area, why(points)))
    return regions
