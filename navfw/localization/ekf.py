"""The localiser `ekf`: a metric EKF from a known start, corrected by landmarks (METHOD 4.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from navfw.interfaces import Localizer
from navfw.localization.landmark_existence import LandmarkExistence
from navfw.localization.landmark_observations import Looks
from navfw.localization.metric_filter import FilterParams, MetricFilter
from navfw.localization.place_posterior import PlacesNearby, known_start, within
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose
from navfw.topomap import TopoMap

__all__ = ["Ekf"]


class Ekf(Localizer):
    """Odometry and gyro predict (x, y, yaw, gyro bias); landmark detections correct them.

    A detection passes a chi-square gate, and weighs as much as its landmark is trusted to stand
    where the map has it: one that stands elsewhere is soon left out.
    """

    name: ClassVar[str] = "ekf"

    class Params(FilterParams, Localizer.Params):
        """Noise, trust, and when it says that it is lost."""

        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which it is lost")
        ] = 0.2

    params: Params

    _nearby: PlacesNearby | None = None

    def reset(self) -> None:
        """Forget map, start and everything driven since."""
        self._nearby = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Begin at ``pose`` [map frame].

        Raises:
            InputError: ``pose`` is None: an EKF cannot search the whole map.

        """
        instead = "the localizer 'topological' (see the stack 'landmarks')"
        pose = known_start(pose, self.name, instead)
        p = self.params
        self._nearby = PlacesNearby(topo_map)
        self.trust = LandmarkExistence(p.prior)
        self._looks = Looks(topo_map, p.placed)
        self.filter = MetricFilter(p, self.trust, self.robot)
        self.filter.begin(pose, np.diag((p.start_xy**2, p.start_xy**2, p.start_yaw**2)), odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and detections; percepts are not used."""
        if self._nearby is None:
            raise RuntimeError("start() comes before update()")
        self.filter.advance(odometry)
        self.filter.see(self._looks.hear(odometry, detections))
        pose, covariance = self.filter.pose, self.filter.pose_covariance
        confidence = within(covariance)
        return Belief(
            odometry.time,
            pose,
            covariance,
            self._nearby.at(pose, covariance),
            confidence,
            confidence < self.params.lost_below,
            self.filter.updates,
        )
