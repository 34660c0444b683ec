"""The ego map: short-term memory of what stands where around the robot (METHOD 2.11, 2.14).

A square evidence grid in the odom frame that moves along with the robot. Each seen point speaks for
something standing within its uncertainty, and for nothing standing on the way there; evidence fades
with time. It knows only flow and odometry.
"""

from __future__ import annotations

import math
from typing import Annotated

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from navfw.localmap.sensor_kernels import cast_evidence, forget_view, merge_evidence, rays_of
from navfw.movers.tracking import Disc
from navfw.robot import RobotModel
from navfw.signals import Array, Mask, Percept, Pose, Stixels

__all__ = ["OccupancyGrid", "OccupancyParams"]

Positive = Annotated[float, Field(gt=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]

_SHARPEST = 0.02
"""Sigma [1/m] below which no reading is taken at its word."""
_FREES = np.array([1.0, 1.0, 1.0, 1.0, 0.5])
"""How much is seen through, by ``Label``: up to just before the thing, or the floor, that was seen.
That holds for a point of unknown height, too."""
_GAP = np.ones((3, 3), np.uint8)
_BESIDE = 0.1
"""How far [m] beside the robot's middle the floor has to be known."""
_SEEN_OVER = 0.15
"""Height [m] below which a ray that passes tells all about a cell."""


class OccupancyParams(BaseModel):
    """How much is remembered, and how evidence is weighed (log-odds)."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    extent: Annotated[Positive, Field(le=30.0, description="side of the square [m]")] = 8.0
    cell: Annotated[float, Field(ge=0.02, le=0.2, description="cell size [m]")] = 0.05
    hit: Annotated[Positive, Field(description="log-odds of one confident detection")] = 0.6
    free: Annotated[Positive, Field(description="log-odds of one look through")] = 0.33
    least: Annotated[float, Field(lt=0.0, description="lower bound of evidence")] = -1.5
    most: Annotated[Positive, Field(description="upper bound of evidence")] = 3.0
    occupied: Annotated[Positive, Field(description="evidence from which a cell blocks")] = 0.7
    seen_free: Annotated[
        float, Field(lt=0.0, description="evidence below which it is free")
    ] = -0.25
    range: Annotated[Positive, Field(description="farthest detection entered [m]")] = 3.0
    width: Annotated[
        float, Field(gt=0.0, le=3.0, description="part of a reading that hits, each side [sigma]")
    ] = 0.7
    share: Annotated[
        tuple[Share, Share],
        Field(description="a cell's share of a reading that says nothing, and that says all"),
    ] = (0.08, 0.3)
    fade: Annotated[Positive, Field(description="time constant of forgetting [s]")] = 30.0
    glance: Annotated[
        Positive, Field(description="time constant of forgetting free floor within view [s]")
    ] = 1.0
    certainty: Annotated[Share, Field(description="least confidence entered")] = 0.15
    over_share: Annotated[
        Share, Field(description="weight of a free look that passes at camera height")
    ] = 0.2
    drop: Annotated[
        Share, Field(description="weight of a point that seems to lie below the floor")
    ] = 0.2
    top: Annotated[Positive, Field(description="things higher than this are ignored [m]")] = 1.5

    @model_validator(mode="after")
    def _shares_rise(self) -> OccupancyParams:
        if self.share[0] >= self.share[1]:
            raise ValueError(f"share must rise: {self.share[0]:g} is not below {self.share[1]:g}")
        return self


class OccupancyGrid:
    """Evidence around the robot; clearances derived from it on demand.

    ``origin`` is the odom position [m] of the centre of cell [0, 0]; arrays are (n, n), [y, x].
    """

    def __init__(self, robot: RobotModel, params: OccupancyParams | None = None) -> None:
        self.robot = robot
        self.params = params or OccupancyParams()
        self.size = 2 * round(0.5 * self.params.extent / self.params.cell) + 1
        self._base_from_camera = robot.camera.base_from_camera
        p = self.params
        # wider by a gap: what shrinks by both is shrunk at once
        self._beside = np.ones((2 * round(_BESIDE / p.cell) + len(_GAP),) * 2, np.uint8)
        self._limits = np.array([p.range, p.width, *p.share, _SEEN_OVER, p.over_share])
        self._hits = np.array([0.0, 0.0, 1.0, p.drop, 1.0])  # in the order of Label
        self._body = _disc(round(robot.radius / p.cell))
        # the layers of one frame, empty between frames
        self._hit, self._free = np.zeros((2, self.size, self.size))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.evidence: Array = np.zeros((self.size, self.size))
        self._origin: tuple[float, float] | None = None
        self._time: float | None = None
        self._looked: float | None = None
        self._taken: tuple[Disc, ...] = ()
        self._clearance: Array | None = None
        self._known: npt.NDArray[np.uint8] | None = None
        self._familiar: npt.NDArray[np.uint8] | None = None

    # --- writing ---------------------------------------------------------------------------------

    def move(self, pose: Pose, time: float) -> None:
        """Follow the robot (odom ``pose``), let old evidence fade, mark the robot's own place."""
        cell = self.params.cell
        half = self.size // 2
        corner = (
            (round(pose.x / cell) - half) * cell,
            (round(pose.y / cell) - half) * cell,
        )
        if self._origin is None:
            self._origin = corner
        else:
            shift = [
                round((new - old) / cell) for new, old in zip(corner, self.origin, strict=True)
            ]
            if max(abs(s) for s in shift) > round(0.4 / cell):
                self.evidence = _shifted(self.evidence, *shift)
                self._origin = corner
        if self._time is not None and time > self._time:
            self.evidence *= math.exp((self._time - time) / self.params.fade)
        self._time = time
        self._mark_body(pose)
        self._clearance = self._known = self._familiar = None

    def _mark_body(self, pose: Pose) -> None:
        """Where the robot stands, nothing else does."""
        row, column = self.index(pose.x, pose.y)
        reach = len(self._body) // 2
        window = np.s_[row - reach : row + reach + 1, column - reach : column + reach + 1]
        self.evidence[window][self._body] = self.params.least

    def enter(self, percept: Percept, pose: Pose) -> None:
        """Enter what ``percept`` saw from odom ``pose`` (call ``move`` first)."""
        p, camera = self.params, self.robot.camera
        confidence = percept.confidence.ravel()
        nearness = percept.nearness.ravel()
        label = percept.label.ravel()
        kept = (confidence >= p.certainty) & (nearness > 1e-3) & (percept.height.ravel() < p.top)
        if not kept.any():
            return
        confidence = np.where(kept, confidence, 0.0)  # what has none leaves no evidence
        sigma = np.maximum(percept.sigma.ravel(), _SHARPEST)
        points = percept.points
        # A cell stands for all that its column shows: rays at its middle and toward both its sides
        # keep far walls from falling apart into dots.
        third = (points[0, -1, 0] - points[0, 0, 0]) / max(points.shape[1] - 1, 1) / 3.0
        rays = rays_of(points.reshape(-1, 2), third, camera.focal, self._base_from_camera, pose.yaw)
        at = self._eye(pose)
        self._forget_view(at, pose.yaw, percept.time)
        hit, free = confidence * self._hits[label], confidence * _FREES[label]
        self._cast(at, rays, nearness, sigma, hit, free)

    def integrate_stixels(self, standing: Stixels, pose: Pose) -> None:
        """Enter what stands in small columns, seen from odom ``pose``: it says hit, never free."""
        kept = (standing.confidence > 0.0) & (standing.nearness > 1e-3)
        if not kept.any():
            return
        slope = standing.slope[kept]
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        rays = np.stack([c - s * slope, s + c * slope, np.zeros(slope.size)], axis=1)
        self._cast(
            self._eye(pose),
            rays,
            standing.nearness[kept],
            np.maximum(standing.sigma[kept], _SHARPEST),
            standing.confidence[kept],
            np.zeros(slope.size),
        )

    def _eye(self, pose: Pose) -> tuple[float, float]:
        """Where the camera is in odom [m]."""
        return pose.to_parent(self.robot.camera.mount_forward, 0.0)

    def _cast(
        self,
        at: tuple[float, float],
        rays: Array,
        nearness: Array,
        sigma: Array,
        hit: Array,
        free: Array,
    ) -> None:
        """Join a frame's detections with what is remembered; see ``cast_evidence``."""
        p = self.params
        cast_evidence(
            self._hit,
            self._free,
            self.origin[0],
            self.origin[1],
            p.cell,
            *at,
            self.robot.camera.mount_height,
            rays,
            nearness,
            sigma,
            hit,
            free,
            self._limits,
        )
        merge_evidence(self.evidence, self._hit, self._free, p.hit, p.free, p.least, p.most)
        self._clearance = self._known = self._familiar = None

    def _forget_view(self, at: tuple[float, float], yaw: float, time: float) -> None:
        """Doubt the free floor within view; see ``forget_view``."""
        since = 0.0 if self._looked is None else max(0.0, time - self._looked)
        self._looked = time
        forget_view(
            self.evidence,
            (at[1] - self.origin[1]) / self.params.cell,
            (at[0] - self.origin[0]) / self.params.cell,
            yaw,
            math.tan(0.5 * self.robot.camera.hfov),
            self.params.range / self.params.cell,
            math.exp(-since / self.params.glance),
        )

    def take(self, discs: tuple[Disc, ...]) -> None:
        """Floor that counts as occupied until the next call."""
        if discs or self._taken:
            self._clearance = None
        self._taken = discs

    def beside(self, discs: tuple[Disc, ...]) -> Array:
        """(n, n) ``clearance``, were ``discs`` taken as well."""
        if not discs:
            return self.clearance
        return self._distance(self._painted(self.occupied, discs))

    # --- reading ---------------------------------------------------------------------------------

    @property
    def origin(self) -> tuple[float, float]:
        """Odom position [m] of the centre of cell [0, 0]; there is none before ``move``."""
        if self._origin is None:
            raise RuntimeError("the ego map has no place yet; call move first")
        return self._origin

    def index(self, x: float, y: float) -> tuple[int, int]:
        """(row, column) of the odom point (x, y); may lie outside the grid."""
        cell = self.params.cell
        return round((y - self.origin[1]) / cell), round((x - self.origin[0]) / cell)

    @property
    def occupied(self) -> Mask:
        """(n, n) True where evidence says that something stands."""
        return self._painted(self.evidence >= self.params.occupied, self._taken)

    def _painted(self, occupied: Mask, discs: tuple[Disc, ...]) -> Mask:
        """``occupied`` (n, n) and all cells within ``discs``."""
        if not discs:
            return occupied
        painted = occupied.astype(np.uint8)
        for disc in discs:
            row, column = self.index(disc.x, disc.y)
            cv2.circle(painted, (column, row), round(disc.radius / self.params.cell), 1, cv2.FILLED)
        return painted.astype(np.bool_)

    @property
    def known(self) -> npt.NDArray[np.uint8]:
        """(n, n) 1 where the cell has been seen free, else 0."""
        if self._known is None:
            self._known = (self.evidence <= self.params.seen_free).view(np.uint8)
        return self._known

    @property
    def familiar(self) -> npt.NDArray[np.uint8]:
        """(n, n) 1 where the cell and what lies beside it has been seen free, else 0.

        Gaps of one cell between the rays of a sparse grid are closed; a robot whose middle keeps to
        such cells brushes past nothing that it has never seen.
        """
        if self._familiar is None:
            widened = cv2.dilate(self.known, _GAP)
            self._familiar = cv2.erode(widened, self._beside).astype(np.uint8, copy=False)
        return self._familiar

    @property
    def clearance(self) -> Array:
        """(n, n) distance [m] from each cell to the nearest occupied cell."""
        if self._clearance is None:
            self._clearance = self._distance(self.occupied)
        return self._clearance

    def _distance(self, occupied: Mask) -> Array:
        """(n, n) distance [m] from each cell to the nearest of ``occupied`` (n, n)."""
        if not occupied.any():
            return np.full((self.size, self.size), self.params.extent)
        distance = cv2.distanceTransform((~occupied).view(np.uint8), cv2.DIST_L2, 5)
        return np.multiply(distance, self.params.cell, dtype=np.float64)


def _disc(radius: int) -> Mask:
    """(2 radius + 1, 2 radius + 1) True within ``radius`` [cells] of the middle."""
    offsets = np.arange(-radius, radius + 1)
    disc: Mask = offsets[:, None] ** 2 + offsets[None, :] ** 2 <= radius**2
    return disc


def _shifted(grid: Array, columns: int, rows: int) -> Array:
    """``grid`` seen from an origin moved by (columns, rows); what comes into view is unknown."""
    n = grid.shape[0]
    moved = np.zeros_like(grid)
    if abs(columns) >= n or abs(rows) >= n:
        return moved
    target = np.s_[max(0, -rows) : n - max(0, rows), max(0, -columns) : n - max(0, columns)]
    source = np.s_[max(0, rows) : n + min(0, rows), max(0, columns) : n + min(0, columns)]
    moved[target] = grid[source]
    return moved
