"""The discrete Bayes filter over the lattice: predict by odometry, correct by what is seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from navfw.interfaces import Params
from navfw.localization.landmark_existence import LandmarkExistence
from navfw.localization.landmark_model import ELSEWHERE
from navfw.localization.landmark_observations import Look, agreeing
from navfw.localization.lattice import Lattice
from navfw.localization.place_posterior import COUNT
from navfw.localization.situation_model import LEARNT, SituationTable
from navfw.signals import Array, Odometry, Pose, wrap_angle
from navfw.topomap import TopoMap

__all__ = ["Cluster", "DiscreteFilter", "DiscreteParams"]

FACING = math.radians(80.0)
"""A landmark is seen from its front only, up to this angle off its normal."""

SAME = 0.75
"""A landmark seen supports a pose if it then lies so near its place in the map [m]."""

LASTING = 30.0
"""What has been seen supports a pose until the robot has driven so much farther [m]."""

LEAST_TRUST = 0.3
"""No landmark is trusted less: who doubts all of them never finds out that he is elsewhere."""

CLUSTER = 1.0
"""Probability so near a pose [m] counts as that pose's."""


class DiscreteParams(Params):
    """How fine the lattice is, and how it moves."""

    cell: Annotated[float, Field(ge=0.1, le=2.0, description="length of a cell [m]")] = 0.25
    headings: Annotated[int, Field(ge=4, le=72, description="directions that are told apart")] = 24
    turning: Annotated[
        float,
        Field(ge=0.0, le=0.3, description="share that passes to each next direction, by cell"),
    ] = 0.002
    leak: Annotated[
        float,
        Field(ge=0.0, le=0.1, description="share that may be anywhere after all, by cell driven"),
    ] = 1e-4
    situation_every: Annotated[
        float, Field(ge=0.1, le=50.0, description="way between two uses of OFFIS' situations [m]")
    ] = 1.0
    situation_weight: Annotated[
        float,
        Field(ge=0.0, le=1.0, description="exponent on each use: they are not independent"),
    ] = 0.5
    situations: Annotated[
        str,
        Field(
            description="what OFFIS says where: learnt, none, or a file of navfw learn situations"
        ),
    ] = LEARNT


@dataclass(frozen=True, slots=True)
class Cluster:
    """The likeliest pose, the ``mass`` of probability around it, and its spread.

    ``covariance`` (3, 3) is that within the cluster, ``spread`` (3, 3) that of the whole belief.
    """

    pose: Pose
    mass: float
    covariance: Array
    spread: Array


class DiscreteFilter:
    """Probabilities (headings, rows, columns) of where the robot was when they last moved.

    What odometry has moved since is pending: the belief is moved cell by cell, as moving it more
    often would blur it. ``table`` says what OFFIS says where; without one it is not heard.
    ``version`` is another object after every change of the belief.
    """

    version: object = None

    def __init__(
        self,
        topo_map: TopoMap,
        params: DiscreteParams,
        prior: float,
        trust: LandmarkExistence,
        table: SituationTable | None = None,
    ) -> None:
        self.params = params
        self.table = table
        self.prior = prior
        self.trust = trust
        self.lattice = Lattice(topo_map, params.cell, params.headings)
        self._map = topo_map
        self._names = list(topo_map.places)
        self._seen: dict[str, tuple[Look, float]] = {}

    def begin(self, pose: Pose | None, odometry: Odometry, sigma: float = 0.2) -> None:
        """Start around ``pose`` (map), or anywhere."""
        self._moved_at = odometry.pose
        self._last = odometry.pose
        self._driven = 0.0
        self._judged_at = 0.0
        self._seen.clear()
        self._cluster: Cluster | None = None
        self.version = object()
        self.belief = self.lattice.uniform()
        if pose is None:
            return
        lattice = self.lattice
        sigma = max(sigma, lattice.cell)
        x = np.exp(-0.5 * ((lattice.x - pose.x) / sigma) ** 2)
        y = np.exp(-0.5 * ((lattice.y - pose.y) / sigma) ** 2)
        off = _wrapped(lattice.yaw - (pose.yaw - odometry.pose.yaw))
        width = 2.0 * math.pi / lattice.headings
        yaw = np.exp(-0.5 * (off / (0.5 * width)) ** 2)
        around = yaw[:, None, None] * y[None, :, None] * x[None, None, :]
        self.belief = (self.belief * 1e-6 + around * lattice.domain).astype(np.float32)
        self._normalise()

    def advance(self, odometry: Odometry, situations: Mapping[str, float] | None) -> None:
        """Move as odometry has, as soon as that makes a cell; hear OFFIS now and then.

        ``situations`` are the degrees that OFFIS gives them, if it has just said anything.
        """
        step = math.hypot(odometry.pose.x - self._last.x, odometry.pose.y - self._last.y)
        self._driven += step
        self._last = odometry.pose
        dx, dy = odometry.pose.x - self._moved_at.x, odometry.pose.y - self._moved_at.y
        if math.hypot(dx, dy) >= self.lattice.cell:
            self._move(dx, dy)
            self._moved_at = odometry.pose
        due = self._driven - self._judged_at >= self.params.situation_every
        if situations is not None and due and self.table is not None:
            self._judged_at = self._driven
            likelihoods = self.table.likelihoods(self._map, situations)
            if likelihoods is not None:
                likelihoods **= self.params.situation_weight
                self.belief *= likelihoods[self.lattice.place].astype(np.float32)[None]
                self._normalise()

    def see(self, looks: Sequence[Look]) -> None:
        """Weigh all poses by landmarks."""
        for look in looks:
            identity = look.landmark.identity
            self._seen[identity] = (look, self._driven)
            self._weigh(look, max(self.trust.of(identity), LEAST_TRUST))

    def evidence(self, pose: Pose) -> float:
        """The probability that not all landmarks which support ``pose`` (map) are misplaced.

        What the metric filter has come to doubt counts too: that filter may be where it is not.
        """
        return float(1.0 - (1.0 - self.prior) ** len(self.supporting(pose)))

    def supporting(self, pose: Pose) -> list[str]:
        """The landmarks seen of late that lie where they should if the robot is at ``pose``.

        Of landmarks that lie as far from each other as in the map: a pose that suits two of them
        half and half suits neither.
        """
        fitting = [
            (look, driven)
            for look, driven in self._seen.values()
            if self._driven - driven <= LASTING and self._fits(look, pose)
        ]
        return [look.landmark.identity for look in agreeing(fitting)]

    def mass_near(self, pose: Pose, radius: float) -> float:
        """The probability of being within ``radius`` [m] of ``pose`` (map), heading alike."""
        lattice = self.lattice
        turned = wrap_angle(pose.yaw - self._last.yaw)
        headings = np.abs(_wrapped(lattice.yaw - turned)) <= 5.0 * math.pi / lattice.headings
        at = self._before(pose, turned)
        rows, columns = self._window(*at, radius)
        near = np.hypot(lattice.x[columns][None, :] - at[0], lattice.y[rows][:, None] - at[1])
        part = self.belief[:, rows, columns][headings]
        return float((part * (near <= radius)[None]).sum())

    @property
    def cluster(self) -> Cluster:
        """The likeliest pose now (worked out when the belief has changed)."""
        if self._cluster is None:
            self._cluster = self._find_cluster()
        return self._moved_on(self._cluster)

    @property
    def place_probabilities(self) -> Array:
        """(places,) the probability of being nearest to each place, in the map's order."""
        layer = self.belief.sum(axis=0)
        place = self.lattice.place.ravel()
        sums = np.bincount(place, weights=layer.ravel(), minlength=len(self._names))
        return sums.astype(np.float64)

    @property
    def places(self) -> Mapping[str, float]:
        """The likeliest places with their probabilities, likeliest first."""
        sums = self.place_probabilities
        order = np.argsort(-sums, kind="stable")[:COUNT].tolist()
        return {self._names[i]: float(sums[i]) for i in order}

    # --- within ------------------------------------------------------------------------------

    def _move(self, dx: float, dy: float) -> None:
        """Shift every layer by the way (dx, dy) [m, odom], turned by the layer's yaw."""
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
        if p.leak > 0.0:
            self.belief *= np.float32(1.0 - p.leak)
            self.belief += np.float32(p.leak / lattice.states) * lattice.domain[None]

    def _weigh(self, look: Look, trust: float) -> None:
        """Multiply by the likelihood ratio of ``look``: in its place, against elsewhere."""
        lattice, mark = self.lattice, look.landmark
        dx, dy = look.x - self._moved_at.x, look.y - self._moved_at.y
        distance, bearing = math.hypot(dx, dy), math.atan2(dy, dx)
        place = lattice.cell**2 / 12.0
        sigma_range = math.sqrt(look.noise[1, 1] + place)
        bin_width = 2.0 * math.pi / lattice.headings
        angle_variance = look.noise[0, 0] + bin_width**2 / 12.0 + place / max(distance, 0.3) ** 2
        sigma_angle = math.sqrt(angle_variance)
        rows, columns = self._window(mark.x, mark.y, distance + 4.0 * sigma_range)
        to_x = mark.x - lattice.x[columns][None, :]
        to_y = mark.y - lattice.y[rows][:, None]
        direction = np.arctan2(to_y, to_x)
        front = np.abs(_wrapped(direction + math.pi - mark.yaw)) <= FACING
        ring = np.exp(-0.5 * ((np.hypot(to_x, to_y) - distance) / sigma_range) ** 2) * front
        off = _wrapped(direction[None] - bearing - lattice.yaw[:, None, None])
        toward = np.exp(-0.5 * (off / sigma_angle) ** 2)
        peak = 1.0 / (2.0 * math.pi * sigma_range * sigma_angle * ELSEWHERE)
        odds = trust / (1.0 - trust) * peak
        ratio = (1.0 + odds * ring[None] * toward) ** look.weight
        self.belief[:, rows, columns] *= ratio.astype(np.float32)
        self._normalise()

    def _window(self, x: float, y: float, radius: float) -> tuple[slice, slice]:
        """The (rows, columns) within ``radius`` [m] of the point, and a few more."""
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
        self._cluster = None
        self.version = object()
        total = float(self.belief.sum(dtype=np.float64))
        if not math.isfinite(total) or total < 1e-20:
            self.belief = self.lattice.uniform()  # the map has no place for what has happened
            return
        self.belief *= np.float32(1.0 / total)

    def _find_cluster(self) -> Cluster:
        """The cluster around the likeliest cell, at the time of the last move."""
        lattice = self.lattice
        heading, row, column = np.unravel_index(int(self.belief.argmax()), self.belief.shape)
        near = np.arange(-2, 3)
        headings = (int(heading) + near) % lattice.headings
        x0, y0 = float(lattice.x[column]), float(lattice.y[row])
        rows, columns = self._window(x0, y0, CLUSTER)
        part = self.belief[:, rows, columns][headings].astype(np.float64)
        dx, dy = lattice.x[columns] - x0, lattice.y[rows] - y0
        part *= (np.hypot(dx[None, :], dy[:, None]) <= CLUSTER)[None]
        mass = float(part.sum())
        dyaw = near * (2.0 * math.pi / lattice.headings)
        grids = np.meshgrid(dyaw, dy, dx, indexing="ij")
        yaws, ys, xs = (np.asarray(grid).ravel() for grid in grids)
        weights = part.ravel() / mass
        samples = np.stack([xs, ys, yaws])
        mean = samples @ weights
        off = samples - mean[:, None]
        covariance = (off * weights) @ off.T
        place, turn = lattice.cell**2 / 12.0, (2.0 * math.pi / lattice.headings) ** 2 / 12.0
        covariance += np.diag((place, place, turn))
        pose = Pose(x0 + float(mean[0]), y0 + float(mean[1]), float(mean[2] + lattice.yaw[heading]))
        return Cluster(pose, mass, covariance, self._spread(pose) + np.diag((place, place, turn)))

    def _spread(self, pose: Pose) -> Array:
        """(3, 3) the second moments of the whole belief about ``pose``."""
        layer = self.belief.sum(axis=0, dtype=np.float64)
        dx, dy = self.lattice.x - pose.x, self.lattice.y - pose.y
        along_x, along_y = layer.sum(axis=0), layer.sum(axis=1)
        spread = np.zeros((3, 3))
        spread[0, 0], spread[1, 1] = float(along_x @ dx**2), float(along_y @ dy**2)
        spread[0, 1] = spread[1, 0] = float(dy @ layer @ dx)
        yaws = self.belief.sum(axis=(1, 2), dtype=np.float64)
        spread[2, 2] = float(yaws @ _wrapped(self.lattice.yaw - pose.yaw) ** 2)
        return spread

    def _moved_on(self, cluster: Cluster) -> Cluster:
        """The cluster, by what odometry has moved since; its yaw is that of the robot."""
        turned = cluster.pose.yaw
        dx, dy = self._last.x - self._moved_at.x, self._last.y - self._moved_at.y
        c, s = math.cos(turned), math.sin(turned)
        pose = Pose(
            cluster.pose.x + c * dx - s * dy,
            cluster.pose.y + s * dx + c * dy,
            wrap_angle(turned + self._last.yaw),
        )
        return Cluster(pose, cluster.mass, cluster.covariance, cluster.spread)

    def _before(self, pose: Pose, turned: float) -> tuple[float, float]:
        """Where a robot that is at ``pose`` now was when the belief last moved."""
        dx, dy = self._last.x - self._moved_at.x, self._last.y - self._moved_at.y
        c, s = math.cos(turned), math.sin(turned)
        return pose.x - c * dx + s * dy, pose.y - s * dx - c * dy

    def _fits(self, look: Look, pose: Pose) -> bool:
        local = self._last.to_local(look.x, look.y)
        x, y = pose.to_parent(*local)
        slack = SAME + 0.1 * math.hypot(*local)
        return math.hypot(x - look.landmark.x, y - look.landmark.y) <= slack


def _wrapped(angle: npt.NDArray[np.float64]) -> Array:
    """Angles [rad] in [-pi, pi)."""
    return np.asarray((angle + math.pi) % (2.0 * math.pi) - math.pi)
