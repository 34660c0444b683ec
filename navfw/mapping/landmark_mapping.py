"""Landmark mapping: landmark positions estimated from the odometry and detections of one drive.

Averaging each landmark's detections over the odometry poses would average the drift as well. So the
robot's poses and the landmarks are estimated together in a pose graph: a landmark detected again
later bounds the drift in between, and a few false detections do no harm.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain, count, pairwise

import numpy as np

from navfw.errors import MapError
from navfw.mapping.pose_graph import UNKNOWN, KeyPoseGraph, Relation
from navfw.numerics.linear_systems import inverse
from navfw.numerics.products import product
from navfw.signals import LandmarkDetection, Pose
from navfw.topomap import Landmark, TopoMap

_STEP_SHARE, _STEP_FLOOR = 0.02, 0.004  # chosen
"""Standard deviation of an odometry increment's length: share of it, and floor [m]."""
_TURN_SHARE, _TURN_FLOOR = 0.01, 0.004  # chosen
"""Standard deviation of an odometry increment's turn: share of it, and floor [rad]."""
_MAX_POSES = 600  # chosen
"""Poses in the graph: beyond this number they are thinned out."""
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
        graph = _LandmarkGraph(self.start, poses, images, wanted)
        return [graph.estimate(number, name) for number, name in enumerate(wanted)]


class _LandmarkGraph:
    """The graph of a drive's poses, behind them the landmarks, whose heading does not count."""

    def __init__(
        self,
        start: Pose,
        odometry: Sequence[Pose],
        images: Sequence[tuple[LandmarkDetection, ...]],
        names: Sequence[str],
    ) -> None:
        self._graph = graph = KeyPoseGraph()
        graph.add(start)
        for before, pose in pairwise([Pose(0.0, 0.0, 0.0), *odometry]):
            step = before.relative(pose)
            along = _STEP_SHARE * math.hypot(step.x, step.y) + _STEP_FLOOR
            turn = _TURN_SHARE * abs(step.yaw) + _TURN_FLOOR
            information = np.diag([along**-2, along**-2, turn**-2])
            graph.add(graph.poses[-1].compose(step), step, information)
        self._first = len(graph.poses)
        self._views: list[list[int]] = [[] for _ in names]
        guesses: list[list[tuple[float, float]]] = [[] for _ in names]
        for at, detections in enumerate(images, 1):
            for detection in detections:
                if detection.identity in names:
                    number = names.index(detection.identity)
                    relation = _relation(at, self._first + number, detection)
                    graph.matches.append(relation)
                    self._views[number].append(at)
                    seen = relation.measured
                    guesses[number].append(graph.poses[at].to_parent(seen.x, seen.y))
        for seen_at in guesses:
            x, y = np.median(seen_at, axis=0).tolist()
            place = Pose(x, y, 0.0)
            graph.add(place, graph.poses[-1].relative(place), UNKNOWN)
        graph.optimize()

    def estimate(self, number: int, identity: str) -> LandmarkEstimate:
        """Return the estimate of the landmark of that ``number``."""
        mark = self._graph.poses[self._first + number]
        spread = self._graph.covariance(self._first + number)
        sigma = math.sqrt(max(float(spread[0, 0]), float(spread[1, 1])))
        views = [self._graph.poses[at] for at in self._views[number]]
        away = np.array([(pose.x - mark.x, pose.y - mark.y) for pose in views])
        away /= np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-6)[:, None]
        x, y = away.mean(axis=0).tolist()
        yaw = math.atan2(y, x)
        return LandmarkEstimate(identity, mark.x, mark.y, yaw, sigma, len(views))


def _relation(pose: int, mark: int, detection: LandmarkDetection) -> Relation:
    """Return a detection as a relation between two poses: of the second one's position only."""
    c, s, away = math.cos(detection.bearing), math.sin(detection.bearing), detection.range
    of_measured = np.array([[-away * s, c], [away * c, s]])  # the position by bearing and range
    information = np.zeros((3, 3))
    information[:2, :2] = inverse(product(of_measured, detection.covariance, of_measured.T))
    return Relation(pose, mark, Pose(away * c, away * s, 0.0), information)


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
