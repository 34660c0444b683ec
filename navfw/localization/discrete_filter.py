"""The discrete Bayes filter over the lattice: predicted by odometry, corrected by observations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.interfaces import Params
from navfw.localization.landmark_model import (
    ELSEWHERE_DENSITY,
    LandmarkExistence,
    LandmarkObservation,
    consistent_observations,
)
from navfw.localization.lattice import Lattice
from navfw.localization.place_probabilities import COUNT, LEARNT, SituationTable
from navfw.numerics import Array
from navfw.numerics.functions import arctan2, exp, power
from navfw.numerics.products import product
from navfw.signals import Odometry, Pose
from navfw.topomap import TopoMap

HEADINGS = 24  # chosen
"""Number of heading bins."""
LEAK = 1e-4  # chosen
"""Probability spread over the whole map, per cell driven."""
SITUATION_EVERY = 1.0  # chosen
"""Distance between two uses of OFFIS' situations [m]."""
SITUATION_WEIGHT = 0.5  # chosen
"""Exponent on their likelihood: uses are not independent."""

_FACING = math.radians(80.0)  # chosen
"""A landmark is visible from its front only, up to this angle off its normal [rad]."""

_SUPPORT_DISTANCE = 0.75  # chosen
"""An observation supports a pose if it puts the landmark within this distance [m], plus a tenth of
the range, of its mapped position."""

_SUPPORT_MEMORY = 30.0  # chosen
"""Distance driven [m] for which an observation can support a pose."""

_MIN_EXISTENCE = 0.3  # chosen
"""Lower bound on the existence probability used here: if all landmarks were discounted after a
wrong start, the filter could not find the right pose."""

_CLUSTER_RADIUS = 1.0  # chosen
"""Radius of the cluster around the likeliest cell [m]."""


class DiscreteParams(Params):
    """Resolution of the lattice, process noise, and use of OFFIS' situations."""

    cell: float = Field(0.25, ge=0.1, le=2.0, description="length of a cell [m]")
    turning: float = Field(
        0.002,
        ge=0.0,
        le=0.3,
        description="probability passed to each next heading, per cell driven",
    )
    situations: str = Field(
        LEARNT,
        description="table of situations by kind of place: learnt, none, or a file of navfw "
        "map learn-situations",
    )


@dataclass(frozen=True, slots=True)
class Cluster:
    """The likeliest pose (map) and the probability ``mass`` within 1 m and 2 headings of it.

    ``covariance`` (3, 3) of (x, y, yaw) is that within the cluster, ``spread`` (3, 3) the second
    moments of the whole belief about ``pose``.
    """

    pose: Pose
    mass: float
    covariance: Array
    spread: Array


class DiscreteFilter:
    """Bayes filter over a lattice of poses, to find an unknown pose by odometry and observations.

    ``belief`` (headings, rows, columns) is shifted only after each cell's length driven, as more
    frequent shifts would blur it; the motion since is kept beside it. ``prior`` is the landmarks'
    existence probability, ``table`` the probabilities of OFFIS' situations (None: not used).
    ``version`` is a new object after every change of the belief.
    """

    version: object = None

    def __init__(
        self,
        topo_map: TopoMap,
        params: DiscreteParams,
        prior: float,
        existence: LandmarkExistence,
        table: SituationTable | None = None,
    ) -> None:
        self.params = params
        self.table = table
        self.prior = prior
        self.existence = existence
        self.lattice = Lattice(topo_map, params.cell, HEADINGS)
        self._map = topo_map
        self._names = list(topo_map.places)
        self._observed: dict[str, tuple[LandmarkObservation, float]] = {}

    def initialize(self, pose: Pose | None, odometry: Odometry, sigma: float = 0.2) -> None:
        """Start around ``pose`` (map) with ``sigma`` [m]; uniformly over the map if it is None."""
        self._shifted_at = odometry.pose
        self._last = odometry.pose
        self._driven = 0.0
        self._situations_used_at = 0.0
        self._observed.clear()
        self._cluster: Cluster | None = None
        self._places: Mapping[str, float] | None = None
        self.version = object()
        self.belief = self.lattice.uniform()
        if pose is None:
            return
        lattice = self.lattice
        sigma = max(sigma, lattice.cell)
        x = exp(-0.5 * ((lattice.x - pose.x) / sigma) ** 2)
        y = exp(-0.5 * ((lattice.y - pose.y) / sigma) ** 2)
        off = _wrapped(lattice.yaw - (pose.yaw - odometry.pose.yaw))
        width = 2.0 * math.pi / lattice.headings
        yaw = exp(-0.5 * (off / (0.5 * width)) ** 2)
        around = yaw[:, None, None] * y[None, :, None] * x[None, None, :]
        self.belief = (self.belief * 1e-6 + around * lattice.domain).astype(np.float32)
        self._normalise()

    def predict(self, odometry: Odometry) -> None:
        """Add the newest odometry; shift the belief once the motion is a cell's length."""
        self._driven += math.hypot(odometry.pose.x - self._last.x, odometry.pose.y - self._last.y)
        self._last = odometry.pose
        dx, dy = odometry.pose.x - self._shifted_at.x, odometry.pose.y - self._shifted_at.y
        if math.hypot(dx, dy) >= self.lattice.cell:
            self._shift(dx, dy)
            self._shifted_at = odometry.pose

    def observe_situations(self, situations: Mapping[str, float] | None) -> None:
        """Correct the belief by OFFIS' ``situations``, degrees by name, once per metre driven.

        None (no percept, or one without depth) changes nothing.
        """
        due = self._driven - self._situations_used_at >= SITUATION_EVERY
        if situations is not None and due and self.table is not None:
            self._situations_used_at = self._driven
            likelihoods = self.table.likelihoods(self._map, situations)
            if likelihoods is not None:
                likelihoods **= SITUATION_WEIGHT
                self.belief *= likelihoods[self.lattice.place].astype(np.float32)[None]
                self._normalise()

    def observe(self, observations: Sequence[LandmarkObservation]) -> None:
        """Correct the belief by landmark observations."""
        for observation in observations:
            identity = observation.landmark.identity
            self._observed[identity] = (observation, self._driven)
            self._correct(observation, max(self.existence.probability(identity), _MIN_EXISTENCE))

    def support_probability(self, pose: Pose) -> float:
        """Return the probability that a landmark that supports ``pose`` (map) is in its place.

        Uses the prior, not the current existence probabilities: the metric filter lowers those of
        correct landmarks while it is itself at a wrong pose.
        """
        return float(1.0 - (1.0 - self.prior) ** len(self.supporting(pose)))

    def supporting(self, pose: Pose) -> list[str]:
        """Return identities of landmarks observed in the last 30 m that fit the map from ``pose``.

        Only mutually consistent observations count: a pose halfway between the poses that two
        landmarks suggest is supported by neither.
        """
        fitting = [
            (observation, driven)
            for observation, driven in self._observed.values()
            if self._driven - driven <= _SUPPORT_MEMORY and self._fits(observation, pose)
        ]
        return [observation.landmark.identity for observation in consistent_observations(fitting)]

    @property
    def cluster(self) -> Cluster:
        """The cluster around the likeliest pose, moved by odometry to the present."""
        if self._cluster is None:
            self._cluster = self._find_cluster()
        return self._at_present(self._cluster)

    @property
    def place_probabilities(self) -> Array:
        """Probability (places,) of being nearest to each place, in the map's order."""
        layer = self.belief.sum(axis=0)
        place = self.lattice.place.ravel()
        sums = np.bincount(place, weights=layer.ravel(), minlength=len(self._names))
        return sums.astype(np.float64)

    @property
    def places(self) -> Mapping[str, float]:
        """Probabilities of the 8 likeliest places by name, likeliest first."""
        if self._places is None:
            sums = self.place_probabilities
            order = np.argsort(-sums, kind="stable")[:COUNT].tolist()
            self._places = {self._names[i]: float(sums[i]) for i in order}
        return self._places

    def _shift(self, dx: float, dy: float) -> None:
        """Shift every layer by (dx, dy) [m, odom], rotated by the layer's yaw."""
        lattice, p = self.lattice, self.params
        c, s = np.cos(lattice.yaw), np.sin(lattice.yaw)
        columns, rows = (c * dx - s * dy) / lattice.cell, (s * dx + c * dy) / lattice.cell
        size = (lattice.shape[1], lattice.shape[0])
        for layer, column, row in zip(self.belief, columns.tolist(), rows.tolist(), strict=True):
            shift = np.array([[1.0, 0.0, column], [0.0, 1.0, row]])
            layer[...] = cv2.warpAffine(layer, shift, size, flags=cv2.INTER_LINEAR)
        if p.turning > 0.0:
            beside = np.roll(self.belief, 1, axis=0) + np.roll(self.belief, -1, axis=0)
            self.belief = (1.0 - 2.0 * p.turning) * self.belief + p.turning * beside
        self.belief *= lattice.keep[None]
        self._normalise()
        self.belief *= np.float32(1.0 - LEAK)
        self.belief += np.float32(LEAK / lattice.states) * lattice.domain[None]

    def _correct(self, observation: LandmarkObservation, existence: float) -> None:
        """Multiply by the likelihood ratio: landmark in its place, over landmark elsewhere."""
        lattice, mark = self.lattice, observation.landmark
        noise = observation.noise
        dx, dy = observation.x - self._shifted_at.x, observation.y - self._shifted_at.y
        distance, bearing = math.hypot(dx, dy), math.atan2(dy, dx)
        place = lattice.cell**2 / 12.0
        sigma_range = math.sqrt(noise[1, 1] + place)
        bin_width = 2.0 * math.pi / lattice.headings
        angle_variance = noise[0, 0] + bin_width**2 / 12.0 + place / max(distance, 0.3) ** 2
        sigma_angle = math.sqrt(angle_variance)
        rows, columns = self._window(mark.x, mark.y, distance + 4.0 * sigma_range)
        to_x = mark.x - lattice.x[columns][None, :]
        to_y = mark.y - lattice.y[rows][:, None]
        direction = arctan2(to_y, to_x)
        front = np.abs(_wrapped(direction + math.pi - mark.yaw)) <= _FACING
        ring = exp(-0.5 * ((np.hypot(to_x, to_y) - distance) / sigma_range) ** 2) * front
        off = _wrapped(direction[None] - bearing - lattice.yaw[:, None, None])
        toward = exp(-0.5 * (off / sigma_angle) ** 2)
        peak = 1.0 / (2.0 * math.pi * sigma_range * sigma_angle * ELSEWHERE_DENSITY)
        odds = existence / (1.0 - existence) * peak
        ratio = power(1.0 + odds * ring[None] * toward, observation.weight)
        self.belief[:, rows, columns] *= ratio.astype(np.float32)
        self._normalise()

    def _window(self, x: float, y: float, radius: float) -> tuple[slice, slice]:
        """Return the (rows, columns) within ``radius`` [m] of the point, and a margin."""
        lattice = self.lattice
        rows, columns = (
            slice(
                min(max(0, math.floor(centre - radius / lattice.cell)), size - 1),
                max(1, math.ceil(centre + radius / lattice.cell) + 1),
            )
            for centre, size in (
                (lattice.row(y), lattice.shape[0]),
                (lattice.column(x), lattice.shape[1]),
            )
        )
        return rows, columns

    def _normalise(self) -> None:
        self._cluster = self._places = None
        self.version = object()
        total = float(self.belief.sum(dtype=np.float64))
        if not math.isfinite(total) or total < 1e-20:
            self.belief = self.lattice.uniform()  # driven off the map: start again
            return
        self.belief *= np.float32(1.0 / total)

    def _find_cluster(self) -> Cluster:
        """Compute the cluster around the likeliest cell, at the time of the last shift."""
        lattice = self.lattice
        heading, row, column = np.unravel_index(int(self.belief.argmax()), self.belief.shape)
        near = np.arange(-2, 3)
        headings = (int(heading) + near) % lattice.headings
        x0, y0 = float(lattice.x[column]), float(lattice.y[row])
        rows, columns = self._window(x0, y0, _CLUSTER_RADIUS)
        window = self.belief[:, rows, columns][headings].astype(np.float64)
        dx, dy = lattice.x[columns] - x0, lattice.y[rows] - y0
        window *= (np.hypot(dx[None, :], dy[:, None]) <= _CLUSTER_RADIUS)[None]
        mass = float(window.sum())
        dyaw = near * (2.0 * math.pi / lattice.headings)
        grids = np.meshgrid(dyaw, dy, dx, indexing="ij")
        yaws, ys, xs = (np.asarray(grid).ravel() for grid in grids)
        weights = window.ravel() / mass
        samples = np.stack([xs, ys, yaws])
        mean = product(samples, weights)
        off = samples - mean[:, None]
        covariance = product(off * weights, off.T)
        place, turn = lattice.cell**2 / 12.0, (2.0 * math.pi / lattice.headings) ** 2 / 12.0
        covariance += np.diag((place, place, turn))
        pose = Pose(x0 + float(mean[0]), y0 + float(mean[1]), float(mean[2] + lattice.yaw[heading]))
        # the sum of rounded shares can exceed 1 a little
        return Cluster(
            pose, min(mass, 1.0), covariance, self._spread(pose) + np.diag((place, place, turn))
        )

    def _spread(self, pose: Pose) -> Array:
        """Compute the second moments (3, 3) of the whole belief about ``pose``."""
        layer = self.belief.sum(axis=0, dtype=np.float64)
        dx, dy = self.lattice.x - pose.x, self.lattice.y - pose.y
        along_x, along_y = layer.sum(axis=0), layer.sum(axis=1)
        spread = np.zeros((3, 3))
        spread[0, 0], spread[1, 1] = float(product(along_x, dx**2)), float(product(along_y, dy**2))
        spread[0, 1] = spread[1, 0] = float(product(dy, layer, dx))
        yaws = self.belief.sum(axis=(1, 2), dtype=np.float64)
        spread[2, 2] = float(product(yaws, _wrapped(self.lattice.yaw - pose.yaw) ** 2))
        return spread

    def _at_present(self, cluster: Cluster) -> Cluster:
        """Move the cluster by the odometry since the last shift; its yaw becomes the robot's."""
        dx, dy = self._last.x - self._shifted_at.x, self._last.y - self._shifted_at.y
        pose = cluster.pose.compose(Pose(dx, dy, self._last.yaw))
        return Cluster(pose, cluster.mass, cluster.covariance, cluster.spread)

    def _fits(self, observation: LandmarkObservation, pose: Pose) -> bool:
        mark = observation.landmark
        local = self._last.to_local(observation.x, observation.y)
        x, y = pose.to_parent(*local)
        slack = _SUPPORT_DISTANCE + 0.1 * math.hypot(*local)
        return math.hypot(x - mark.x, y - mark.y) <= slack


def _wrapped(angle: npt.NDArray[np.float64]) -> Array:
    """Wrap angles [rad] to [-pi, pi)."""
    return np.asarray((angle + math.pi) % (2.0 * math.pi) - math.pi)
