"""The rolling occupancy grid around the robot (METHOD 2.11, 2.14).

A square grid of log-odds in the odom frame that moves along with the robot. Each observed point is
evidence for an obstacle within its uncertainty, and for free space in front of it. Evidence
decays with time. The grid is built from flow and odometry only.
"""

from __future__ import annotations

import math
from typing import Annotated

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.localmap.cell_arrays import cell_disc, clipped_cells, distances, marked_cells, shifted
from navfw.localmap.low_layer import add_low_things, with_low_things
from navfw.localmap.sensor_kernels import cast_evidence, decay_view, merge_evidence, rays_of
from navfw.numerics import Array, Mask
from navfw.robot import Footprint, RobotModel
from navfw.signals import OccupiedDisc, Percept, Pose, Stixels

CLAMP_MIN = -1.5  # chosen
"""Lower bound of the log-odds."""
CLAMP_MAX = 3.0  # chosen
"""Upper bound of the log-odds."""
OBSERVED_FREE = -0.25  # chosen
"""Log-odds up to which a cell is observed free."""
HIT_WIDTH = 0.7  # chosen
"""Depth interval that a hit covers, each side [sigma]."""
VIEW_DECAY = 1.0  # chosen
"""Time constant of free evidence within the view [s]."""
MIN_CONFIDENCE = 0.15  # chosen
"""Least confidence integrated."""
OVER_WEIGHT = 0.2  # chosen
"""Weight of free evidence of a ray at camera height."""
DROP_WEIGHT = 0.2  # chosen
"""Weight as a hit of a point below the floor."""
MAX_HEIGHT = 1.5  # chosen
"""Height above which points are ignored [m]."""

Positive = Annotated[float, Field(gt=0.0, le=100.0)]
"""Log-odds, lengths [m] and times [s]: beyond 100 nothing changes any more."""
Share = Annotated[float, Field(ge=0.0, le=1.0)]

_MIN_SIGMA = 0.02  # chosen
"""Lower bound of the sigma of nearness [1/m]: no measurement is taken to be more exact."""
_FREE_WEIGHTS = np.array([1.0, 1.0, 1.0, 1.0, 0.5])  # chosen
"""Weight of the free evidence along a ray, by ``Label`` of its end point. The ray is free up to the
point regardless of its height, so UNKNOWN counts in full; ABOVE passes over much of the floor."""
_WEAK_SIGHT = np.array([0.0, 1.0, 1.0, 0.0, 0.0])  # chosen
"""Weight of the free evidence if there is little texture: a window then takes the motion of the
strongest edge in it, often of one far behind, and its ray would pass through nearer surfaces."""
_WEAK_OCCUPIED = 0.3  # chosen
"""Log-odds from which a cell is occupied where there is little texture: matches are too few there
for the evidence of a surface to add up before the robot has reached it."""
_GAP = np.ones((3, 3), np.uint8)  # defined
"""Structuring element that closes gaps of one cell between the rays of a sparse flow grid."""
_SIDE_MARGIN = 0.1  # measured
"""Distance [m] beside a path within which floor has to be observed; with more, the robot creeps."""
_LOW_PASS = 0.15  # chosen
"""Height [m] below which a passing ray is full evidence for a free cell."""
WALL_DEPTH = 0.15  # chosen
"""Depth [m] behind what is seen of a wall that may be wall as well, unless it is observed free."""
_DOUBT = 1.6  # chosen
"""Distance [m] from the camera up to which the floor is in doubt when something has appeared."""
_SHIFT = 0.4  # chosen
"""Distance [m] from the grid's centre at which the grid is shifted; shifting costs a copy."""


class OccupancyParams(StrictModel):
    """Size of the grid, and how evidence is weighed (log-odds)."""

    extent: float = Field(8.0, gt=0.0, le=30.0, description="side of the square [m]")
    cell: float = Field(0.05, ge=0.02, le=0.2, description="cell size [m]")
    hit: Positive = Field(0.6, description="log-odds added by one certain hit")
    miss: Positive = Field(0.33, description="log-odds removed by one ray that passes")
    occupied: Positive = Field(0.7, description="log-odds from which a cell is occupied")
    range: Positive = Field(3.0, description="largest range of a hit [m]")
    cell_share: tuple[Share, Share] = Field(
        (0.08, 0.3), description="probability within one cell that gives no hit, and a full hit"
    )
    decay: Positive = Field(30.0, description="time constant of the decay of evidence [s]")

    @model_validator(mode="after")
    def _shares_rise(self) -> OccupancyParams:
        low, high = self.cell_share
        if low >= high:
            raise ValueError(f"cell_share must rise: {low:g} is not below {high:g}")
        return self


class OccupancyGrid:
    """A square of log-odds of occupancy that rolls with the robot; clearances are derived from it.

    ``log_odds`` and all other arrays are (n, n), indexed [row, column] = [y, x]; ``origin`` is the
    odom position [m] of the centre of cell [0, 0]. A cell of log-odds 0 has no evidence. ``driven``
    is 1 along the track of the robot's rear; the camera sees no floor nearer than ``blind`` [m].
    """

    def __init__(self, robot: RobotModel, params: OccupancyParams | None = None) -> None:
        self.robot = robot
        self.params = params or OccupancyParams()
        self.size = 2 * round(0.5 * self.params.extent / self.params.cell) + 1
        self._base_from_camera = robot.camera.base_from_camera
        p = self.params
        # wider by the closed gap: one erosion takes back both
        self._margin = np.ones((2 * round(_SIDE_MARGIN / p.cell) + len(_GAP),) * 2, np.uint8)
        self._body = cell_disc(round(robot.radius / p.cell) + len(_GAP) // 2).view(np.uint8)
        shares = *p.cell_share, _LOW_PASS, OVER_WEIGHT
        self.blind = robot.camera.floor_in_view_from
        self._limits = np.array([p.range, HIT_WIDTH, *shares, self.blind])
        self._hit_weights = np.array([0.0, 0.0, 1.0, DROP_WEIGHT, 1.0])  # in the order of Label
        self._footprint = cell_disc(round(robot.radius / p.cell))
        # the evidence of one frame; zero between frames
        self._hit, self._free = np.zeros((2, self.size, self.size))
        self.reset()

    def reset(self) -> None:
        """Empty the grid; it has no position until the next ``update``."""
        self.log_odds: Array = np.zeros((self.size, self.size))
        self._origin: tuple[float, float] | None = None
        self._time: float | None = None
        self._last_view: float | None = None
        self._weak_sight = False
        self._obstacles: tuple[OccupiedDisc, ...] = ()
        self._walls: Array = np.empty((0, 2))
        self._doubted, self.driven, self.low = np.zeros((3, self.size, self.size))
        self._clearance: Array | None = None
        self._blind_clearance: Array | None = None
        self._observed: npt.NDArray[np.uint8] | None = None
        self._footprint_observed: npt.NDArray[np.uint8] | None = None

    # --- writing ---------------------------------------------------------------------------------

    def update(self, pose: Pose, time: float) -> None:
        """Move the grid with odom ``pose``, decay the evidence, mark the footprint as free."""
        cell = self.params.cell
        half = self.size // 2
        corner = (round(pose.x / cell) - half) * cell, (round(pose.y / cell) - half) * cell
        if self._origin is None:
            self._origin = corner
        else:
            shift = [round((to - at) / cell) for to, at in zip(corner, self._origin, strict=True)]
            if max(abs(s) for s in shift) > round(_SHIFT / cell):
                grids = self.log_odds, self._doubted, self.driven, self.low
                moved = [shifted(grid, *shift) for grid in grids]
                self.log_odds, self._doubted, self.driven, self.low = moved
                self._origin = corner
        if self._time is not None and time > self._time:
            kept = math.exp((self._time - time) / self.params.decay)
            self.log_odds *= kept
            self.low *= kept
        self._time = time
        self._mark_footprint(pose)
        rear = min(disc[0] for disc in self.robot.discs)
        rim = pose.to_parent(rear - self.robot.disc_radius + 1.5 * cell, 0.0)
        end = self.index(*pose.to_parent(rear, 0.0))[::-1]
        cv2.line(self.driven, self.index(*rim)[::-1], end, 1)
        self._forget_derived()

    def _mark_footprint(self, pose: Pose) -> None:
        if self.robot.footprint is not None:
            self._mark_rectangle(self.robot.footprint, pose)
            return
        row, column = self.index(pose.x, pose.y)
        reach = len(self._footprint) // 2
        window = np.s_[row - reach : row + reach + 1, column - reach : column + reach + 1]
        self.log_odds[window][self._footprint] = CLAMP_MIN

    def _mark_rectangle(self, footprint: Footprint, pose: Pose) -> None:
        front, rear, half = footprint.front, -footprint.rear, 0.5 * footprint.width
        corners = (front, half), (front, -half), (rear, -half), (rear, half)
        cells = [self.index(*pose.to_parent(*corner))[::-1] for corner in corners]
        under = np.zeros(self.log_odds.shape, np.uint8)
        cv2.fillConvexPoly(under, np.array(cells), 1)
        self.log_odds[under > 0] = CLAMP_MIN

    def integrate(self, percept: Percept, pose: Pose, *, weak: bool = False) -> None:
        """Add the evidence of ``percept``, seen from odom ``pose`` (call ``update`` first).

        If sight is ``weak``, only rays to floor and to obstacles are evidence for free space, less
        evidence makes a cell occupied, and floor has to be observed under the whole body.
        """
        self._weak_sight = weak
        p, camera = self.params, self.robot.camera
        confidence = percept.confidence.ravel()
        nearness = percept.nearness.ravel()
        label = percept.label.ravel()
        kept = (confidence >= MIN_CONFIDENCE) & (nearness > 1e-3)
        kept &= percept.height.ravel() < MAX_HEIGHT
        if not kept.any():
            return
        confidence = np.where(kept, confidence, 0.0)  # zero weight: no evidence
        sigma = np.maximum(percept.sigma.ravel(), _MIN_SIGMA)
        points = percept.points
        # A flow cell stands for its whole width: three rays, at its centre and a third of its width
        # to either side, keep distant walls from falling apart into dots.
        third = (points[0, -1, 0] - points[0, 0, 0]) / max(points.shape[1] - 1, 1) / 3.0
        rays = rays_of(points.reshape(-1, 2), third, camera.focal, self._base_from_camera, pose.yaw)
        since = 0.0 if self._last_view is None else max(0.0, percept.time - self._last_view)
        self._last_view = percept.time
        self._scale_view(self.log_odds, pose, 0.0, p.range, math.exp(-since / VIEW_DECAY))
        hit = confidence * self._hit_weights[label]
        free = confidence * (_WEAK_SIGHT if weak else _FREE_WEIGHTS)[label]
        self._cast(self._camera_position(pose), rays, nearness, sigma, hit, free)

    def doubt_view(self, pose: Pose) -> None:
        """From now on count floor in view from odom ``pose`` as occupied unless observed free.

        What has appeared there hides most of the floor that it stands on, and a robot that stops
        before it has no parallax to see its near side either.
        """
        view = np.full(self.log_odds.shape, -1.0)
        for grid in (view, self.log_odds):
            self._scale_view(grid, pose, self.blind, _DOUBT, 0.0)
        self._doubted[view == 0.0] = 1.0
        self._forget_derived()

    def integrate_stixels(self, stixels: Stixels, pose: Pose) -> None:
        """Add the evidence of ``stixels``, seen from odom ``pose``: hits, no free space."""
        kept = (stixels.confidence > 0.0) & (stixels.nearness > 1e-3)
        if not kept.any():
            return
        slope = stixels.slope[kept]
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        rays = np.stack([c - s * slope, s + c * slope, np.zeros(slope.size)], axis=1)
        self._cast(
            self._camera_position(pose),
            rays,
            stixels.nearness[kept],
            np.maximum(stixels.sigma[kept], _MIN_SIGMA),
            stixels.confidence[kept],
            np.zeros(slope.size),
        )

    def integrate_low(self, low_things: Array, pose: Pose) -> None:
        """Add the evidence of ``low_things`` (n, 3), seen from odom ``pose``."""
        seen = pose.points_to_parent(low_things[:, :2])
        at, _ = clipped_cells(seen, self.origin, self.params.cell, self.size)
        add_low_things(self.low, at, low_things[:, 2])
        self._forget_derived()

    def _camera_position(self, pose: Pose) -> tuple[float, float]:
        """Return the position (x, y) [m] of the camera in odom."""
        return pose.to_parent(self.robot.camera.mount_forward, 0.0)

    def _cast(
        self, at: tuple[float, float], *evidence: *tuple[Array, Array, Array, Array, Array]
    ) -> None:
        """Cast and merge ``evidence``: rays, their nearness, sigma, weights of hit and free."""
        p = self.params
        grids, height = (self._hit, self._free, self.log_odds), self.robot.camera.mount_height
        cast_evidence(*grids, *self.origin, p.cell, *at, height, *evidence, self._limits)
        merge_evidence(self.log_odds, self._hit, self._free, p.hit, p.miss, CLAMP_MIN, CLAMP_MAX)
        self._forget_derived()

    def _scale_view(self, grid: Array, pose: Pose, near: float, far: float, keep: float) -> None:
        """Scale what is negative in the view, from ``near`` to ``far`` [m], of odom ``pose``."""
        x, y = self._camera_position(pose)
        cell, slope = self.params.cell, math.tan(0.5 * self.robot.camera.hfov)
        at = (y - self.origin[1]) / cell, (x - self.origin[0]) / cell
        decay_view(grid, *at, pose.yaw, slope, near / cell, far / cell, keep)

    def set_obstacles(self, discs: tuple[OccupiedDisc, ...]) -> None:
        """Count ``discs`` as occupied until the next call, regardless of the log-odds."""
        if discs or self._obstacles:
            self._clearance = self._blind_clearance = None
        self._obstacles = discs

    def set_walls(self, points: Array) -> None:
        """Set odom ``points`` (n, 2) [m] of known walls: clearances count them where unobserved."""
        self._walls = points
        self._clearance = self._blind_clearance = None

    def _forget_derived(self) -> None:
        self._clearance = self._blind_clearance = None
        self._observed = self._footprint_observed = None

    # --- reading ---------------------------------------------------------------------------------

    @property
    def origin(self) -> tuple[float, float]:
        """Odom position (x, y) [m] of the centre of cell [0, 0].

        Raises:
            RuntimeError: the grid has no position before the first ``update``.

        """
        if self._origin is None:
            raise RuntimeError("the occupancy grid has no position yet; call update first")
        return self._origin

    @property
    def located(self) -> bool:
        """Whether the grid has a position: false until the first ``update``."""
        return self._origin is not None

    def contains(self, x: float, y: float) -> bool:
        """Return whether the odom point (x, y) [m] lies on the grid; raises like ``origin``."""
        (left, bottom), side = self.origin, (self.size - 1) * self.params.cell
        return 0.0 <= x - left <= side and 0.0 <= y - bottom <= side

    def occupied_at(self, x: float, y: float) -> bool:
        """Return whether the odom point (x, y) [m] is occupied by what was seen there."""
        return self.contains(x, y) and bool(self.log_odds[self.index(x, y)] >= self.params.occupied)

    def index(self, x: float, y: float) -> tuple[int, int]:
        """Return (row, column) of the odom point (x, y) [m], which may lie outside the grid."""
        cell = self.params.cell
        return round((y - self.origin[1]) / cell), round((x - self.origin[0]) / cell)

    @property
    def occupied(self) -> Mask:
        """Which cells (n, n) are occupied: by log-odds, in doubt, or by a set obstacle."""
        least = min(self.params.occupied, _WEAK_OCCUPIED if self._weak_sight else math.inf)
        occupied = with_low_things(self.log_odds >= least, self.low)
        if self._doubted.any():
            occupied |= (self._doubted > 0.0) & (cv2.dilate(self.observed, _GAP) == 0)
        return self._painted(occupied, self._obstacles)

    def _painted(self, occupied: Mask, discs: tuple[OccupiedDisc, ...]) -> Mask:
        """Return ``occupied`` (n, n) with all cells within ``discs`` added."""
        if not discs:
            return occupied
        painted = occupied.astype(np.uint8)
        for disc in discs:
            row, column = self.index(disc.x, disc.y)
            cv2.circle(painted, (column, row), round(disc.radius / self.params.cell), 1, cv2.FILLED)
        return painted.astype(np.bool_)

    @property
    def observed(self) -> npt.NDArray[np.uint8]:
        """Array (n, n): 1 where the cell has been observed free, else 0."""
        if self._observed is None:
            self._observed = (self.log_odds <= OBSERVED_FREE).view(np.uint8)
        return self._observed

    @property
    def footprint_observed(self) -> npt.NDArray[np.uint8]:
        """Array (n, n): 1 where a cell and its surroundings have been observed free, else 0.

        The surroundings are a square of +-0.1 m, with weak sight the body's circle. Gaps of one
        cell between the rays of a sparse flow grid are closed first.
        """
        if self._footprint_observed is None:
            closed = cv2.dilate(self.observed, _GAP)
            around = self._body if self._weak_sight else self._margin
            self._footprint_observed = cv2.erode(closed, around).astype(np.uint8, copy=False)
        return self._footprint_observed

    @property
    def clearance(self) -> Array:
        """Distance (n, n) [m] to the nearest occupied cell, or unobserved one of a set wall."""
        if self._clearance is None:
            self._clearance = self._distances(self._barring)
        return self._clearance

    def clearance_near(self, x: float, y: float, away: float) -> Array:
        """Compute ``clearance`` (n, n) within +-``away`` [m] of odom x, y; farther off large."""
        if self._clearance is not None:
            return self._clearance
        half = math.ceil(away / self.params.cell)
        window = tuple(slice(max(at - half, 0), at + half + 1) for at in self.index(x, y))
        near = np.full(self.log_odds.shape, self.params.extent)
        near[window] = self._distances(self._barring[window])
        return near

    @property
    def _barring(self) -> Mask:
        """Which cells (n, n) are occupied, or unobserved ones of walls that were set."""
        if not len(self._walls):
            return self.occupied
        walls = marked_cells(self._walls, self.origin, self.params.cell, self.size)
        walls[self.observed != 0] = False
        return self.occupied | walls

    @property
    def blind_clearance(self) -> Array:
        """Clearance (n, n) [m] for parts of a body that go where the camera does not look.

        Unobserved cells within 0.15 m of an occupied one count as occupied too.
        """
        if self._blind_clearance is None:
            hidden = self.clearance <= WALL_DEPTH
            self._blind_clearance = self._distances(hidden & (self.observed == 0) | self._barring)
        return self._blind_clearance

    def clearance_with(self, discs: tuple[OccupiedDisc, ...]) -> Array:
        """Compute the ``clearance`` (n, n) [m] as if ``discs`` were occupied as well."""
        return self._distances(self._painted(self._barring, discs)) if discs else self.clearance

    def _distances(self, occupied: Mask) -> Array:
        return distances(occupied, self.params.cell, self.params.extent)
