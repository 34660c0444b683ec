"""Landmark mapping: landmark positions estimated from the odometry and detections of one drive.

Averaging each landmark's detections over the odometry poses would average the drift as well. So the
robot's poses and the landmarks are estimated together by least squares over odometry increments and
detections (a pose graph): a landmark detected again later bounds the drift in between. Residuals
beyond ``_HUBER`` sigma get less weight (Huber), so that a few false detections do no harm.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count

import numpy as np
import numpy.typing as npt

from navfw.errors import MapError
from navfw.numerics import Array
from navfw.numerics.linear_systems import inverse, solve
from navfw.numerics.products import product
from navfw.signals import LandmarkDetection, Pose, wrap_angle
from navfw.topomap.elements import Landmark
from navfw.topomap.topological_map import TopoMap

_HUBER = 2.0  # chosen
_ITERATIONS = 12  # chosen
_STEP_SHARE, _STEP_FLOOR = 0.02, 0.004  # chosen
"""Standard deviation of an odometry increment's length: share of it, and floor [m]."""
_TURN_SHARE, _TURN_FLOOR = 0.01, 0.004  # chosen
"""Standard deviation of an odometry increment's turn: share of it, and floor [rad]."""
_MAX_POSES = 600  # chosen
"""Poses in the graph: beyond this number they are thinned out, as the cost grows with the cube."""
_DEFAULT_HEIGHT = 0.35  # chosen
"""Height [m] given to landmarks that are not in the map yet: detections do not measure it."""


@dataclass(frozen=True, slots=True)
class LandmarkEstimate:
    """An estimated landmark: x, y [m] and ``yaw`` [rad] in ``map``, ``sigma`` [m] of its position.

    ``yaw`` is the mean direction from which it was observed, accurate to some tens of degrees;
    ``observations`` is the number of detections.
    """

    identity: str
    x: float
    y: float
    yaw: float
    sigma: float
    observations: int


@dataclass(slots=True)
class LandmarkMapper:
    """Collects detections of a drive that began at ``start`` (map) to estimate landmark poses."""

    start: Pose
    _poses: list[Pose] = field(init=False, default_factory=list)
    _detections: list[tuple[LandmarkDetection, ...]] = field(init=False, default_factory=list)

    def integrate(self, pose: Pose, detections: Sequence[LandmarkDetection]) -> None:
        """Add the detections of one image, taken from ``pose`` by odometry since the start."""
        if detections:
            self._poses.append(pose)
            self._detections.append(tuple(detections))

    def estimate(self, least: int = 3) -> list[LandmarkEstimate]:
        """Estimate all landmarks with at least ``least`` detections, ordered by identity."""
        stride = max(1, math.ceil(len(self._poses) / _MAX_POSES))
        poses, images = self._poses[::stride], self._detections[::stride]
        counts = Counter(detection.identity for detections in images for detection in detections)
        wanted = sorted(name for name, count in counts.items() if count >= least)
        if not wanted:
            return []
        graph = _PoseGraph(self.start, poses, images, {name: i for i, name in enumerate(wanted)})
        graph.solve()
        return [graph.estimate(name, counts[name]) for name in wanted]


class _PoseGraph:
    """Least-squares problem with the unknowns poses (n, 3) and landmarks (m, 2), in one vector."""

    def __init__(
        self,
        start: Pose,
        odometry: Sequence[Pose],
        images: Sequence[tuple[LandmarkDetection, ...]],
        index: Mapping[str, int],
    ) -> None:
        self._start = start
        before = [Pose(0.0, 0.0, 0.0), *odometry[:-1]]  # odometry starts at its own origin
        self._steps = [a.relative(b) for a, b in zip(before, odometry, strict=True)]
        self._poses: list[Pose] = []
        pose = start
        for step in self._steps:
            pose = pose.compose(step)
            self._poses.append(pose)
        self._detections = [
            (i, index[detection.identity], detection)
            for i, detections in enumerate(images)
            for detection in detections
            if detection.identity in index
        ]
        self._index = index
        self._marks = np.zeros((len(index), 2))
        for j in range(len(index)):
            seen = [(self._poses[i], s.range, s.bearing) for i, k, s in self._detections if k == j]
            guesses = [at.to_parent(r * math.cos(b), r * math.sin(b)) for at, r, b in seen]
            self._marks[j] = np.median(guesses, axis=0)
        self._spread: Array = np.zeros((0, 0))

    def solve(self) -> None:
        """Solve by Gauss-Newton iterations with Huber weights."""
        poses = len(self._poses)
        size = 3 * poses + 2 * len(self._index)
        for _ in range(_ITERATIONS):
            normal, right = 1e-9 * np.eye(size), np.zeros(size)
            factors = [self._step_factor(i) for i in range(len(self._steps))]
            factors += [self._detection_factor(*detection) for detection in self._detections]
            for columns, jacobian, residual, information in factors:
                length = math.sqrt(float(product(residual, information, residual)))
                weight = 1.0 if length <= _HUBER else _HUBER / length
                weighted = product(weight * jacobian.T, information)
                normal[np.ix_(columns, columns)] += product(weighted, jacobian)
                right[columns] -= product(weighted, residual)
            step = solve(normal, right)
            for i in range(poses):
                x, y, yaw = step[3 * i : 3 * i + 3].tolist()
                old = self._poses[i]
                self._poses[i] = Pose(old.x + x, old.y + y, wrap_angle(old.yaw + yaw))
            self._marks += step[3 * poses :].reshape(-1, 2)
            if float(np.abs(step).max()) < 1e-4:
                break
        self._spread = np.asarray(inverse(normal), np.float64)

    def estimate(self, identity: str, observations: int) -> LandmarkEstimate:
        """Return the estimate of one landmark."""
        j = self._index[identity]
        x, y = self._marks[j].tolist()
        first = 3 * len(self._poses) + 2 * j
        sigma = math.sqrt(
            max(float(self._spread[first, first]), float(self._spread[first + 1, first + 1]))
        )
        views = [self._poses[i] for i, k, _ in self._detections if k == j]
        away = np.array([[pose.x - x, pose.y - y] for pose in views])
        away /= np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-6)[:, None]
        facing = away.mean(axis=0)
        yaw = math.atan2(facing[1], facing[0])
        return LandmarkEstimate(identity, x, y, yaw, sigma, observations)

    def _step_factor(self, i: int) -> tuple[npt.NDArray[np.int64], Array, Array, Array]:
        """Return columns, Jacobian, residual and information of an odometry step."""
        a = self._start if i == 0 else self._poses[i - 1]
        b, step = self._poses[i], self._steps[i]
        relative = a.relative(b)
        residual = np.array(
            [relative.x - step.x, relative.y - step.y, wrap_angle(relative.yaw - step.yaw)]
        )
        c, s = math.cos(a.yaw), math.sin(a.yaw)
        of_b = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        of_a = -of_b.copy()
        of_a[:2, 2] = relative.y, -relative.x
        along = _STEP_SHARE * math.hypot(step.x, step.y) + _STEP_FLOOR
        turn = _TURN_SHARE * abs(step.yaw) + _TURN_FLOOR
        information = np.diag([along**-2, along**-2, turn**-2])
        if i == 0:
            return np.arange(3), of_b, residual, information
        return np.arange(3 * i - 3, 3 * i + 3), np.hstack([of_a, of_b]), residual, information

    def _detection_factor(
        self, i: int, j: int, detection: LandmarkDetection
    ) -> tuple[npt.NDArray[np.int64], Array, Array, Array]:
        pose, mark = self._poses[i], self._marks[j]
        dx, dy = float(mark[0] - pose.x), float(mark[1] - pose.y)
        away = max(math.hypot(dx, dy), 1e-3)
        bearing = wrap_angle(math.atan2(dy, dx) - pose.yaw)
        residual = np.array([wrap_angle(bearing - detection.bearing), away - detection.range])
        of_mark = np.array([[-dy / away**2, dx / away**2], [dx / away, dy / away]])
        of_pose = np.hstack([-of_mark, np.array([[-1.0], [0.0]])])
        first = 3 * len(self._poses) + 2 * j
        columns = np.r_[3 * i : 3 * i + 3, first : first + 2]
        information = np.asarray(inverse(detection.covariance), np.float64)
        return columns, np.hstack([of_pose, of_mark]), residual, information


def with_landmarks(
    topo_map: TopoMap,
    estimates: Sequence[LandmarkEstimate],
    default_size: Callable[[str], float],
) -> TopoMap:
    """Return the map with the estimates: known landmarks moved (size, height kept), others added.

    ``default_size`` returns the side [m] of a new landmark by its kind; its height is 0.35 m.

    Raises:
        MapError: an identity is not of the form ``KIND-NUMBER``, as ``aruco-7``.

    """
    marks = {mark.identity: mark for mark in topo_map.landmarks.values()}
    names = {mark.name for mark in marks.values()}
    for estimate in estimates:
        old = marks.get(estimate.identity)
        kind, number = _parsed(estimate.identity)
        name = old.name if old is not None else _unused(estimate.identity, names)
        names.add(name)
        height, size = (_DEFAULT_HEIGHT, default_size(kind)) if old is None else (old.z, old.size)
        pose = round(estimate.x, 3), round(estimate.y, 3), round(estimate.yaw, 3)
        marks[estimate.identity] = Landmark(name, kind, number, *pose, z=height, size=size)
    return topo_map.replaced(landmarks=marks.values())


def _parsed(identity: str) -> tuple[str, int]:
    kind, _, number = identity.rpartition("-")
    if not kind or not number.isdecimal():
        raise MapError(
            f"{identity!r} is not the identity of a landmark; expected kind and id, as in aruco-7"
        )
    return kind, int(number)


def _unused(wanted: str, taken: set[str]) -> str:
    """Return ``wanted``, with a number added if a landmark has that name already."""
    names = chain([wanted], (f"{wanted}-{number}" for number in count(2)))
    return next(name for name in names if name not in taken)
