"""The localiser ``topological``, over the places of the map.

It has a discrete Bayes filter over places and passages (METHOD 4.4) to find an unknown start, and
an EKF for tracking. The walls beside the passages of the map correct the pose in corridors and
before doors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw.localization import passage_walls, place_probabilities
from navfw.localization.discrete_filter import Cluster, DiscreteFilter, DiscreteParams
from navfw.localization.landmark_model import (
    LandmarkExistence,
    LandmarkObservation,
    LandmarkObserver,
)
from navfw.localization.metric_filter import MetricFilter, MetricFilterParams
from navfw.localization.plan_field import PlanScan, ScanMemory, scan_of
from navfw.robot import RobotModel
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose, wrap_angle
from navfw.topomap import TopoMap

ADOPT_ABOVE = 0.9  # chosen
"""Probability from which its pose is adopted."""
LOST_BELOW = 0.4  # chosen
"""Confidence below which the belief is lost."""


_SCAN_EVERY = 0.1  # chosen
"""Distance driven [m] between two scans."""

MEMORY, POINTS = 2.0, 2000  # chosen
"""Distance driven [m] whose scans show a corridor, and their number of points."""

_CORRIDOR_EVERY, _DOOR_EVERY = 1.0, 0.3  # chosen
"""Distance driven [m] between two fixes: nearer ones would share most of their points."""

_ALONG = 0.6  # chosen
"""Largest angle [rad] between heading and passage: the camera sees both of its sides."""

MARGIN = 0.2  # chosen
"""Distance [m] beyond the passage at which the believed pose may be, as it may be wrong."""

_MIN_DOOR_DISTANCE, _MAX_DOOR_DISTANCE = 0.4, 2.0  # chosen
"""Distances [m] ahead between which a door's posts are in view and seen well."""


class PassageObserver:
    """Collects scans of walls, and computes corrections of the pose in a map's passages."""

    def __init__(self, topo_map: TopoMap, robot: RobotModel) -> None:
        axes = passage_walls.passage_axes(topo_map)
        self._corridors = [axis for axis in axes if not axis.is_door]
        self._doors = [axis for axis in axes if axis.is_door]
        self._robot = robot
        self._scans = ScanMemory(MEMORY)
        self._last: Pose | None = None
        self._driven = 0.0
        self._scanned_at = self._corridor_at = self._door_at = -math.inf

    def observe(
        self, pose: Pose, odometry: Odometry, percept: Percept | None
    ) -> list[passage_walls.PassageFix]:
        """Compute corrections of the believed ``pose`` (map) by ``percept``; often none."""
        odom = odometry.pose
        if self._last is not None:
            self._driven += math.dist((self._last.x, self._last.y), (odom.x, odom.y))
        self._last = odom
        if percept is None or self._driven - self._scanned_at < _SCAN_EVERY:
            return []
        scan = scan_of(percept, self._robot)
        self._scanned_at = self._driven
        self._scans.add(self._driven, odom, scan)
        fixes = (self._corridor(pose, odom), self._door(pose, scan))
        return [fix for fix in fixes if fix is not None]

    def _corridor(self, pose: Pose, odom: Pose) -> passage_walls.PassageFix | None:
        if self._driven - self._corridor_at < _CORRIDOR_EVERY:
            return None
        axis = next((axis for axis in self._corridors if _is_in(axis, pose)), None)
        if axis is None:
            return None
        fix = passage_walls.corridor_fix(axis, pose, self._scans.cloud(odom, POINTS))
        if fix is not None:
            self._corridor_at = self._driven
        return fix

    def _door(self, pose: Pose, scan: PlanScan) -> passage_walls.PassageFix | None:
        if self._driven - self._door_at < _DOOR_EVERY:
            return None
        axis = next((axis for axis in self._doors if _is_ahead(axis, pose)), None)
        fix = None if axis is None else passage_walls.door_fix(axis, pose, scan)
        if fix is not None:
            self._door_at = self._driven
        return fix


def _is_in(axis: passage_walls.PassageAxis, pose: Pose) -> bool:
    at = axis.frame(pose)
    inside = abs(at.y) <= 0.5 * axis.width + MARGIN
    return inside and -MARGIN <= at.x <= axis.length + MARGIN and axis.heading_off(pose) <= _ALONG


def _is_ahead(axis: passage_walls.PassageAxis, pose: Pose) -> bool:
    at = axis.frame(pose)
    ahead = -at.x if abs(at.yaw) < 0.5 * math.pi else at.x
    in_front = _MIN_DOOR_DISTANCE <= ahead <= _MAX_DOOR_DISTANCE and abs(at.y) <= 0.5 * axis.width
    return in_front and axis.heading_off(pose) <= _ALONG


_SAME_POSE_DISTANCE = 1.5  # chosen
"""Distance [m] up to which the poses of both filters count as the same."""

_SAME_POSE_ANGLE = math.radians(40.0)  # chosen
"""Heading difference [rad] up to which the poses of both filters count as the same."""

_ESTABLISHED_SUPPORT = 4  # chosen
"""Number of supporting landmarks from which a tracked pose counts as established. An established
pose, or a given start, needs one more supporting landmark elsewhere to be replaced."""


class Topological(place_probabilities.PlaceLocalizer):
    """Finds the pose on the whole map by a discrete filter, and tracks it by an EKF.

    The discrete filter always covers the whole map. Once most of its probability lies at one pose
    that two landmarks support, the metric filter is initialised there; when it later lies
    elsewhere, with more supporting landmarks than the tracked pose has, the metric filter is
    initialised again there. While the two disagree the confidence falls; below 0.4 the belief is
    lost. The walls beside the map's corridors and doors correct the tracked pose, too.
    """

    name: ClassVar[str] = "topological"

    class Params(place_probabilities.PlaceLocalizer.Params):
        """Both filters, and when the discrete filter's pose is adopted."""

        metric: MetricFilterParams = Field(MetricFilterParams(), description="of the Kalman filter")
        discrete: DiscreteParams = Field(DiscreteParams(), description="of the discrete filter")
        passages: bool = Field(
            True, description="heading and lateral position by the walls beside the map's edges"
        )

    params: Params

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map), or with a uniform belief over the map if it is None."""
        p = self.params
        self._posterior = place_probabilities.PlacePosterior(topo_map)
        self._observer = LandmarkObserver(topo_map)
        self.existence = LandmarkExistence(p.metric.prior)
        table = place_probabilities.situation_table(p.discrete.situations)
        self.discrete = DiscreteFilter(topo_map, p.discrete, p.metric.prior, self.existence, table)
        self.discrete.initialize(pose, odometry)
        self.metric = MetricFilter(p.metric, self.existence, self.robot)
        self._passages = PassageObserver(topo_map, self.robot) if p.passages else None
        self.tracking = pose is not None
        self.relocations = 0
        self._established = pose is not None
        self._disagreement = 0.0
        self._version: object = None
        if pose is not None:
            xy, yaw = p.metric.start_xy**2, p.metric.start_yaw**2
            self.metric.initialize(pose, np.diag((xy, xy, yaw)), odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """Return the belief after the newest odometry, percept (None: none) and detections."""
        posterior = self.posterior
        observations = self._observer.observe(odometry, detections)
        self.discrete.predict(odometry)
        self.discrete.observe_situations(place_probabilities.observed_situations(percept))
        self.discrete.observe(observations)
        if self.tracking:
            self.metric.predict(odometry)
            self.metric.observe(observations)
            self._observe_passages(odometry, percept)
        changed = self._version is not self.discrete.version
        self._version = self.discrete.version
        if observations or changed:
            self._compare(odometry, observations)
        return self._belief(posterior, odometry)

    def _observe_passages(self, odometry: Odometry, percept: Percept | None) -> None:
        """Correct the tracked pose by the walls beside it, unless it is in doubt."""
        if self._passages is None:
            return
        for fix in self._passages.observe(self.metric.pose, odometry, percept):
            if self._disagreement == 0.0:
                self.metric.observe_passage(fix)

    def _compare(self, odometry: Odometry, observations: Sequence[LandmarkObservation]) -> None:
        """Adopt the discrete filter's pose where it is probable, supported, and not tracked."""
        cluster = self.discrete.cluster
        tracked = self.metric.pose if self.tracking else None
        if tracked is not None and _is_same_pose(cluster.pose, tracked):
            self._disagreement = 0.0
            self._established |= len(self.discrete.supporting(tracked)) >= _ESTABLISHED_SUPPORT
            return
        support = len(self.discrete.supporting(cluster.pose))
        self._disagreement = cluster.mass * self.discrete.support_probability(cluster.pose)
        if tracked is not None:
            needed = len(self.discrete.supporting(tracked)) + self._established
            if support <= needed:
                self._disagreement *= 0.5  # the tracked pose is as well supported: equal weight
                return
        if self._disagreement >= ADOPT_ABOVE and observations:
            self._adopt(cluster, odometry, observations)

    def _adopt(
        self, cluster: Cluster, odometry: Odometry, observations: Sequence[LandmarkObservation]
    ) -> None:
        """Initialise the metric filter at the cluster, and use the observations there."""
        self.relocations += self.tracking
        self.tracking = True
        self._established = False
        self._disagreement = 0.0
        self.metric.initialize(cluster.pose, cluster.covariance, odometry)
        self.existence.reset(set(self.discrete.supporting(cluster.pose)).__contains__)
        self.metric.observe(observations)

    def _belief(self, posterior: place_probabilities.PlacePosterior, odometry: Odometry) -> Belief:
        lost_below = LOST_BELOW
        if self.tracking:
            pose, covariance = self.metric.pose, self.metric.pose_covariance
            places = posterior.at(pose, covariance)
            confidence = place_probabilities.probability_within(covariance) * (
                1.0 - self._disagreement
            )
        else:
            cluster = self.discrete.cluster
            pose, covariance, places = cluster.pose, cluster.spread, self.discrete.places
            confidence = cluster.mass * self.discrete.support_probability(cluster.pose)
            confidence = min(confidence, 0.99 * lost_below)  # lost until a pose has been adopted
        lost, updates = confidence < lost_below, self.metric.updates
        return Belief(odometry.time, pose, covariance, places, confidence, lost, updates)


def _is_same_pose(a: Pose, b: Pose) -> bool:
    near = math.hypot(a.x - b.x, a.y - b.y) <= _SAME_POSE_DISTANCE
    return near and abs(wrap_angle(a.yaw - b.yaw)) <= _SAME_POSE_ANGLE
