"""The localiser `topological`: a discrete Bayes filter for the whole map, an EKF for here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw.interfaces import Localizer
from navfw.localization.discrete_filter import Cluster, DiscreteFilter, DiscreteParams
from navfw.localization.landmark_existence import LandmarkExistence
from navfw.localization.landmark_observations import Look, Looks
from navfw.localization.metric_filter import FilterParams, MetricFilter
from navfw.localization.place_posterior import PlacesNearby, within
from navfw.localization.situation_model import heard, situation_table
from navfw.signals import Array, Belief, LandmarkDetection, Odometry, Percept, Pose, wrap_angle
from navfw.topomap import TopoMap

__all__ = ["Topological"]

APART = 1.5
"""Both filters speak of the same place when no farther apart than this [m]."""

TURNED = math.radians(40.0)
"""... and when their headings differ less than this."""

ROOTED = 4
"""A start that was told, or a pose that so many landmarks have supported, counts as one more."""


class Topological(Localizer):
    """Finds out where it is with the one filter and keeps it with the other.

    The discrete filter weighs the whole map at all times. As soon as most of its probability lies
    at one pose that two landmarks support, the metric filter begins there; when it later lies
    elsewhere, and more landmarks support that, the metric filter begins again there. While the two
    contradict each other the confidence falls, and what is below ``lost_below`` is lost.
    """

    name: ClassVar[str] = "topological"

    class Params(Localizer.Params):
        """Both filters, and when to believe the discrete one."""

        metric: Annotated[FilterParams, Field(description="of the Kalman filter")] = FilterParams()
        discrete: Annotated[DiscreteParams, Field(description="of the filter over places")] = (
            DiscreteParams()
        )
        sure: Annotated[
            float, Field(gt=0.5, lt=1.0, description="probability from which a pose is taken")
        ] = 0.9
        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which it is lost")
        ] = 0.4

    params: Params

    _nearby: PlacesNearby | None = None

    def reset(self) -> None:
        """Forget map, start and everything driven since."""
        self._nearby = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Begin at ``pose`` [map frame], or anywhere."""
        p = self.params
        self._nearby = PlacesNearby(topo_map)
        self._looks = Looks(topo_map, p.metric.placed)
        self.trust = LandmarkExistence(p.metric.prior)
        self.discrete = DiscreteFilter(
            topo_map, p.discrete, p.metric.prior, self.trust, situation_table(p.discrete.situations)
        )
        self.discrete.begin(pose, odometry)
        self.metric = MetricFilter(p.metric, self.trust, self.robot)
        self.tracking = pose is not None
        self.relocations = 0
        self._rooted = pose is not None
        self._conflict = 0.0
        self._version: object = None
        self._places: Mapping[str, float] = {}
        if pose is not None:
            xy, yaw = p.metric.start_xy**2, p.metric.start_yaw**2
            self.metric.begin(pose, np.diag((xy, xy, yaw)), odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and, where there are any, percept and detections."""
        if self._nearby is None:
            raise RuntimeError("start() comes before update()")
        looks = self._looks.hear(odometry, detections)
        self.discrete.advance(odometry, heard(percept))
        self.discrete.see(looks)
        if self.tracking:
            self.metric.advance(odometry)
            self.metric.see(looks)
        changed = self._version is not self.discrete.version
        self._version = self.discrete.version
        if looks or changed:
            self._compare(odometry, looks)
        if self.tracking:
            return self._tracked(self._nearby, odometry)
        return self._sought(odometry, changed)

    def _compare(self, odometry: Odometry, looks: Sequence[Look]) -> None:
        """Begin to track where the discrete filter is sure, if that is not where it is tracked."""
        cluster = self.discrete.cluster
        here = self.metric.pose if self.tracking else None
        if here is not None and _same(cluster.pose, here):
            self._conflict = 0.0
            self._rooted |= len(self.discrete.supporting(here)) >= ROOTED
            return
        support = len(self.discrete.supporting(cluster.pose))
        self._conflict = cluster.mass * self.discrete.evidence(cluster.pose)
        if here is not None and support <= len(self.discrete.supporting(here)) + self._rooted:
            self._conflict *= 0.5  # what has been tracked so far has its own weight
            return
        if self._conflict >= self.params.sure and looks:
            self._begin(cluster, odometry, looks)

    def _begin(self, cluster: Cluster, odometry: Odometry, looks: Sequence[Look]) -> None:
        self.relocations += self.tracking
        self.tracking = True
        self._rooted = False
        self._conflict = 0.0
        self.metric.begin(cluster.pose, cluster.covariance, odometry)
        self.trust.pardon(set(self.discrete.supporting(cluster.pose)).__contains__)
        self.metric.see(looks)

    def _tracked(self, nearby: PlacesNearby, odometry: Odometry) -> Belief:
        pose, covariance = self.metric.pose, self.metric.pose_covariance
        confidence = within(covariance) * (1.0 - self._conflict)
        return self._belief(odometry, pose, covariance, nearby.at(pose, covariance), confidence)

    def _sought(self, odometry: Odometry, changed: bool) -> Belief:
        cluster = self.discrete.cluster
        if changed:
            self._places = self.discrete.places
        confidence = cluster.mass * self.discrete.evidence(cluster.pose)
        # what is not yet tracked is not yet known
        confidence = min(confidence, 0.99 * self.params.lost_below)
        return self._belief(odometry, cluster.pose, cluster.spread, self._places, confidence)

    def _belief(
        self,
        odometry: Odometry,
        pose: Pose,
        covariance: Array,
        places: Mapping[str, float],
        confidence: float,
    ) -> Belief:
        lost = confidence < self.params.lost_below
        time, updates = odometry.time, self.metric.updates
        return Belief(time, pose, covariance, places, confidence, lost, updates)


def _same(a: Pose, b: Pose) -> bool:
    near = math.hypot(a.x - b.x, a.y - b.y) <= APART
    return near and abs(wrap_angle(a.yaw - b.yaw)) <= TURNED
