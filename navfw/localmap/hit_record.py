"""By what evidence the cells of the local map are occupied: how exact, how high, and when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import uniform_filter1d

from navfw.localmap.cell_arrays import clipped_cells, shifted, without_gaps
from navfw.localmap.occupancy_grid import HIT_WIDTH, MAX_HEIGHT, MIN_CONFIDENCE, OccupancyGrid
from navfw.localmap.sensor_kernels import rays_of
from navfw.numerics import Array, Mask
from navfw.signals import Label, Percept, Pose, Stixels
from navfw.signals.immutability import Frozen

_SHARES = np.linspace(-HIT_WIDTH, HIT_WIDTH, 5)  # chosen
"""Standard deviations of nearness from a reading at which its cells are marked."""
_TAIL, _GAP = 0.4, 0.15  # chosen
"""Length [m] before an obstacle beyond the reach that may be unobserved, as its distance is not
exact; and in all along a free ray: rays of flow are sparse."""
_BLUR = 0.07  # measured
"""Standard deviation [m] that cells and their joining over time add: in generated rooms distances
that readings had to 0.04 m were off by 0.08 m."""
_INNER = 0.875  # derived
"""Share of an occupied cell, between centres of cells, from which a ray meets it: beside its
corners obstacles would be seen wider. It is the largest at which steps of a quarter of a cell miss
none."""
_EDGE = 0.35  # chosen
"""Distance [cells] within which it is not known where an obstacle ends: a ray so near to one that
meets none may pass. In ten generated rooms 1 of 4 false obstacles was there."""
_SPREAD = 1.6  # derived
"""Distance [m] from which evidence is summed along a ray: there 0.02 1/m of nearness, the least
error, are a cell. In six generated rooms 3 of 100 obstacles more are seen."""
_WIDTH, _MIN_MIDDLE, _MIN_SUM = 0.175, 0.1, 2.2  # chosen
"""Over which length [m] it is summed, and the least log-odds in its middle; the least sum at 1 m,
which falls with the distance squared as the share of a reading that is within a cell."""
_HITS = (int(Label.OBSTACLE), int(Label.DROP), int(Label.ABOVE))  # defined


@dataclass(frozen=True, slots=True)
class ViewScan(Frozen):
    """What the local map has along rays from base_link; arrays (n,) by bearing [m].

    ``ranges`` is the distance to the first obstacle that was seen; inf if all ground to the reach
    was observed free, NaN where neither is known, as at an obstacle's edge. ``sigma`` is the
    standard deviation of the distance, NaN without an obstacle. ``free`` is the distance that was
    observed free.
    """

    ranges: Array
    sigma: Array
    free: Array


class HitRecord:
    """Layers beside one ``OccupancyGrid`` that roll with it; it is updated after the grid.

    Arrays (n, n), 0 where nothing was seen: ``precision`` [1/m], the inverse of the standard
    deviation of the distance of the newest readings there; ``seen`` [s], when they were taken, and
    ``height`` [m above floor] of the highest of all.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self._grid = grid
        self.precision, self.seen, self.height = np.zeros((3, grid.size, grid.size))
        self._origin: tuple[float, float] | None = None

    def update(
        self,
        percepts: Sequence[Percept],
        stixels: Stixels | None,
        low_things: Array | None,
        pose: Pose,
        time: float,
    ) -> None:
        """Mark what a frame of ``time`` [s], seen from odom ``pose``, shows of obstacles."""
        self._roll()
        for percept in percepts:
            if percept.sees_depth:
                self._mark_percept(percept, pose, time)
        if stixels is not None:
            kept = (stixels.confidence > 0.0) & (stixels.nearness > 1e-3)
            slope, c, s = stixels.slope[kept], math.cos(pose.yaw), math.sin(pose.yaw)
            rays = np.stack([c - s * slope, s + c * slope], axis=1)
            readings = stixels.nearness[kept], stixels.sigma[kept]
            self._mark(rays, *readings, np.zeros(slope.size), pose, time)
        if low_things is not None:
            self._put(pose.points_to_parent(low_things[:, :2]), 0.0, 0.0, time)

    def _roll(self) -> None:
        grid, last = self._grid, self._origin
        self._origin = grid.origin
        if last is not None and last != grid.origin:
            by = [round((a - b) / grid.params.cell) for a, b in zip(grid.origin, last, strict=True)]
            layers = self.precision, self.seen, self.height
            self.precision, self.seen, self.height = (shifted(layer, *by) for layer in layers)

    def _mark_percept(self, percept: Percept, pose: Pose, time: float) -> None:
        camera, points = self._grid.robot.camera, percept.points
        third = (points[0, -1, 0] - points[0, 0, 0]) / max(points.shape[1] - 1, 1) / 3.0
        rays = rays_of(
            points.reshape(-1, 2), third, camera.focal, camera.base_from_camera, pose.yaw
        )
        kept = (percept.confidence >= MIN_CONFIDENCE) & np.isin(percept.label, _HITS)
        kept &= (percept.nearness > 1e-3) & (percept.height < MAX_HEIGHT)
        thrice = np.tile(kept.ravel(), 3)
        readings = (percept.nearness, percept.sigma, percept.height)
        nearness, sigma, height = (np.tile(values[kept], 3) for values in readings)
        self._mark(rays[thrice, :2], nearness, sigma, height, pose, time)

    def _mark(
        self, rays: Array, nearness: Array, sigma: Array, height: Array, pose: Pose, time: float
    ) -> None:
        """Mark readings (n,): ``rays`` (n, 2) advance in odom x, y per metre of depth."""
        at = np.array(pose.to_parent(self._grid.robot.camera.mount_forward, 0.0))
        spread = np.maximum(nearness + _SHARES[:, None] * sigma, 0.4 * nearness)
        points = at + rays / spread[..., None]
        distance = sigma / nearness**2 * np.hypot(*rays.T)
        self._put(points, np.broadcast_to(distance, spread.shape), height, time)

    def _put(self, points: Array, sigma: Array | float, height: Array | float, time: float) -> None:
        grid = self._grid
        at, inside = clipped_cells(points, grid.origin, grid.params.cell, grid.size)
        at = at[0][inside], at[1][inside]
        sigma, height = (np.broadcast_to(v, inside.shape)[inside] for v in (sigma, height))
        precision = 1.0 / np.hypot(sigma, _BLUR)
        earlier = self.seen[at] < time
        self.precision[at[0][earlier], at[1][earlier]] = 0.0
        np.maximum.at(self.precision, at, precision)
        np.maximum.at(self.height, at, height)
        self.seen[at] = time

    def obstacles(self, pose: Pose, time: float) -> Array:
        """Return the occupied cells (n, 5) as seen from odom ``pose`` at ``time`` [s].

        Columns are x, y [m, base_link], z [m above floor], the standard deviation of the distance
        [m], and the time [s] since a reading showed it; the last two are NaN where none did.
        """
        grid = self._grid
        rows, columns = np.nonzero(grid.occupied)
        points = np.stack([columns, rows], axis=1) * grid.params.cell + np.array(grid.origin)
        layers = self.precision, self.seen, self.height
        precision, seen, height = (_around(layer)[rows, columns] for layer in layers)
        with np.errstate(divide="ignore"):
            sigma = np.where(precision > 0.0, 1.0 / precision, math.nan)
        age = np.where(precision > 0.0, time - seen, math.nan)
        return np.column_stack([pose.points_to_local(points), height, sigma, age])

    def scan(self, pose: Pose, bearings: Array, reach: float) -> ViewScan:
        """Cast a ray of ``reach`` [m] along each of ``bearings`` (n,) [rad] from odom ``pose``.

        Bearings are evenly spaced. An obstacle is as far as the middle of the first occupied cells
        on the ray: an uncertain surface has them to both of its sides.
        """
        grid, step = self._grid, 0.25 * self._grid.params.cell
        steps = np.arange(0.0, reach + _TAIL, step)
        number = np.arange(steps.size)
        ways = np.stack([np.cos(bearings + pose.yaw), np.sin(bearings + pose.yaw)], axis=-1)
        points = np.array((pose.x, pose.y)) + ways[:, None] * steps[:, None]
        at, inside = clipped_cells(points, grid.origin, grid.params.cell, grid.size)
        occupied = self._met(points, steps, grid.log_odds[at] * inside) & inside
        seen = without_gaps(grid.observed > 0)[at] & inside & ~occupied
        first = np.where(occupied.any(axis=1), occupied.argmax(axis=1), steps.size)
        ahead = number >= first[:, None]
        over = ahead & ~occupied
        last = np.where(over.any(axis=1), over.argmax(axis=1), steps.size) - 1
        unseen = ~seen
        free = np.where(unseen.any(axis=1), unseen.argmax(axis=1), steps.size)
        gaps = (unseen & (number < first[:, None] - round(_TAIL / step))).sum(axis=1)
        ranges = np.where(first < steps.size, 0.5 * step * (first + last), math.inf)
        ranges[ranges > reach] = math.inf
        ranges[np.isinf(ranges) & (gaps > _GAP / step)] = math.nan
        ranges[self._at_edge(ranges, bearings)] = math.nan
        precision = _around(self.precision)[at] * (occupied & (number <= last[:, None]))
        with np.errstate(divide="ignore"):
            sigma = np.where(np.isfinite(ranges), 1.0 / precision.max(axis=1), math.nan)
        sigma[np.isinf(sigma)] = math.nan
        return ViewScan(ranges, sigma, np.minimum(free * step, reach))

    def _at_edge(self, ranges: Array, bearings: Array) -> Mask:
        """Whether rays with an obstacle at ``ranges`` (n,) [m] may pass beside it."""
        hit = np.isfinite(ranges)
        between = np.abs(bearings[:, None] - bearings) - 0.5 * (bearings[1] - bearings[0])
        near = between <= _EDGE * self._grid.params.cell / np.where(hit, ranges, math.inf)[:, None]
        return np.asarray(hit & (near & ~hit).any(axis=1))

    def _met(self, points: Array, steps: Array, log_odds: Array) -> Mask:
        """Whether rays meet an obstacle at ``points`` (n, m, 2), ``steps`` (m,) [m] away."""
        grid, count = self._grid, round(_WIDTH / (steps[1] - steps[0]))
        x, y = np.moveaxis((points - np.array(grid.origin)) / grid.params.cell, -1, 0).astype("f4")
        inner = cv2.remap(grid.occupied.astype("f4"), x, y, cv2.INTER_LINEAR) >= _INNER
        summed = uniform_filter1d(log_odds, count, axis=1, mode="constant")
        enough = summed * _WIDTH / grid.params.cell * steps**2 >= _MIN_SUM
        met: Mask = inner | (enough & (log_odds > _MIN_MIDDLE) & (steps > _SPREAD))
        return met


def _around(layer: Array) -> Array:
    """The largest value (n, n) of a ``layer`` in each cell and those beside it: rays are sparse."""
    return np.asarray(cv2.dilate(layer, np.ones((3, 3), np.uint8)))
