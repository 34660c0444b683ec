"""The localiser ``floor_plan``: what the camera sees of walls, matched to the map's floor plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field

from navfw.errors import MapError
from navfw.localization import place_probabilities
from navfw.localization.landmark_model import LandmarkExistence
from navfw.localization.metric_filter import MetricFilter, MetricFilterParams
from navfw.localization.plan_field import PlanField, PlanScan, scan_of
from navfw.localization.plan_search import PlanSearch, are_close
from navfw.numerics import Array
from navfw.numerics.linear_systems import inverse, solve
from navfw.numerics.products import product
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose, Twist, wrap_angle
from navfw.topomap import TopoMap

CONTRADICTED_BELOW = -0.1  # chosen
"""Mean fit of the scans: contradicted below."""
LOST_BELOW = 0.4  # chosen
"""Confidence below which the belief is lost."""

MIN_POINTS = 8  # chosen
"""Least number of points of a scan that is matched."""

GATE = 16.0  # chosen
"""Squared Mahalanobis distance of a fit from the prediction above which it is not used."""

_BLOCKED_COST = 2.0  # chosen
"""How much more a ray that a wall would have blocked speaks against a pose than a point that does
not belong to the plan: furniture explains the point, nothing explains the ray."""

MIN_SHARE = 0.25  # chosen
"""Share of the points that belong to the plan below which a scan shows furniture, and says nothing
of the pose."""

_MAX_SKID = 0.1  # chosen
"""Sigma of the camera's lateral displacement, as a share of its displacement, up to which a scan is
matched: a camera that has moved in another direction distorts the whole scan."""

INFLATION = 2.0  # chosen
"""Factor on the covariance after a fit that was not used: the pose may be wrong."""

_CLEARLY_BETTER = 0.5  # chosen
"""Mean log likelihood of the points that another pose has to fit better than the tracked one
to take its place. Things that the plan does not show cost the tracked pose less; a wrong pose fits
worse by 1 and more."""

_DRIFT_XY, _DRIFT_YAW = 0.1, 0.02  # chosen
"""Standard deviations [m, rad] that are added to the pose's from scan to scan while the plan
contradicts it."""

_MIN_TRUST = 0.02  # chosen
"""Factor on the confidence in a pose that the plan contradicts."""

_TRUSTED_SHARE, _TRUSTED_XY = 0.5, 0.15  # chosen
"""Share of the points that belong to the plan, and standard deviation [m] of the position, with
which a wall that was seen through is not there."""

_SEARCH_XY, _SEARCH_YAW = 0.15, 0.05  # chosen
"""Standard deviations [m, rad] of a pose that the search has found."""


class FloorPlanLocalizer(place_probabilities.PlaceLocalizer):
    """Tracks the pose by an EKF on odometry, corrected by the walls of the map's floor plan.

    Scans are taken some distance apart, since neighbouring ones share their errors. The running
    mean of their ``fit`` to the plan says whether the robot is where it believes: the share of
    points that belong to the plan, less the share of rays that a wall would have blocked. Below
    ``doubt_below`` the whole plan is searched for a clearly better pose, which takes the place of
    the tracked one. Below ``CONTRADICTED_BELOW`` the plan contradicts the tracked pose: either may
    be wrong, so the pose goes on by odometry with growing covariance, and only scans that fit
    correct it. The robot is lost once its confidence is below ``LOST_BELOW``. A wall that the
    camera sees through from a well known pose is taken out of the plan. Landmarks are not used.
    """

    name: ClassVar[str] = "floor_plan"

    class Params(MetricFilterParams, place_probabilities.PlaceLocalizer.Params):
        """Noise of odometry, and when a pose is believed."""

        every: float = Field(
            0.15, ge=0.02, le=2.0, description="distance driven between two scans [m]"
        )
        memory: float = Field(
            8.0, ge=1.0, le=100.0, description="number of scans of the running mean"
        )
        doubt_below: float = Field(
            0.42, ge=0.0, lt=1.0, description="mean fit of the scans: in doubt below"
        )

    params: Params

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map), or with a search of the whole plan if it is None.

        Raises:
            MapError: the map has no floor plan.

        """
        if topo_map.floor_plan is None:
            raise MapError(
                f"the map {topo_map.name!r} has no floor plan, which the localizer 'floor_plan' "
                "needs: name one under the key 'floor_plan' of the map file, or choose "
                "'dead_reckoning'"
            )
        p = self.params
        self._posterior = place_probabilities.PlacePosterior(topo_map)
        self._field = PlanField(topo_map.floor_plan)
        self._search = PlanSearch(topo_map.floor_plan, self._field, self.robot.radius)
        self.filter = MetricFilter(p, LandmarkExistence(p.prior), self.robot)
        self.tracking = pose is not None
        self.fit = 1.0
        self._last = odometry
        self._driven = 0.0
        self._scanned_at = -math.inf
        if pose is not None:
            self._track(pose, p.start_xy, p.start_yaw, odometry)

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """Return the belief after the newest odometry and ``percept``; detections are unused."""
        posterior = self.posterior
        last, self._last = self._last, odometry
        self._driven += math.dist((last.pose.x, last.pose.y), (odometry.pose.x, odometry.pose.y))
        if self.tracking:
            self.filter.predict(odometry)
        scan = self._scan(percept, odometry.twist)
        if scan is not None:
            self._search.add(self._driven, odometry.pose, scan)
            if self.tracking:
                self._correct(scan)
            if not self.tracking or self.fit < self.params.doubt_below:
                self._search.begin()
        self._find(odometry, odometry.time - last.time)
        return self._belief(posterior, odometry)

    def _scan(self, percept: Percept | None, twist: Twist) -> PlanScan | None:
        """Return the points of ``percept``, if the last scan is far enough behind."""
        if percept is None or self._driven - self._scanned_at < self.params.every:
            return None
        if self._skidding(twist):
            return None
        scan = scan_of(percept, self.robot)
        if len(scan.points) < MIN_POINTS:
            return None
        self._scanned_at = self._driven
        return scan

    def _skidding(self, twist: Twist) -> bool:
        """Return whether wheels skid so much in a turn that the camera's direction is unclear."""
        speed = math.hypot(twist.v, twist.w * self.robot.camera.mount_forward)
        return self.robot.skid * abs(twist.w) > _MAX_SKID * speed

    def _correct(self, scan: PlanScan) -> None:
        covariance, pose = self.filter.pose_covariance, self.filter.pose
        information: Array = np.asarray(inverse(covariance), dtype=np.float64)
        match = self._field.match(scan, pose, information)
        at = np.array([[match.pose.x, match.pose.y, match.pose.yaw]])
        fit = match.belonging - _BLOCKED_COST * float(self._field.blocked(scan, at)[0])
        self._judge(fit)
        weight = self._trust(fit)
        if match.belonging < MIN_SHARE or weight == 0.0:
            return
        if weight < 1.0:  # where little fits, walls are mistaken for others
            match = self._field.match(scan, pose, information / weight)
        off = np.array([match.pose.x - pose.x, match.pose.y - pose.y, 0.0])
        off[2] = wrap_angle(match.pose.yaw - pose.yaw)
        if float(product(off, solve(covariance, off))) > GATE:
            self.filter.inflate(INFLATION)
            return
        self.filter.adopt(match.pose, weight * match.information)
        certain = covariance[0, 0] + covariance[1, 1] <= _TRUSTED_XY**2
        if match.belonging >= _TRUSTED_SHARE and certain:
            self._field.see_through(scan, match.pose)

    def _judge(self, fit: float) -> None:
        """Take the fit of a scan into the running mean."""
        doubted = self._contradicted
        self.fit += (fit - self.fit) / self.params.memory
        if self._contradicted:
            self.filter.diffuse(_DRIFT_XY, _DRIFT_YAW)
            if not doubted:  # the robot may have been moved: scans from before say nothing then
                self._search.forget(self._driven - self.params.memory * self.params.every)

    def _trust(self, fit: float) -> float:
        """Return how far a fit is trusted: 1 from ``doubt_below`` on, 0 if nothing fits."""
        return min(max(fit / max(self.params.doubt_below, 1e-6), 0.0), 1.0)

    @property
    def _contradicted(self) -> bool:
        """Whether the plan contradicts the tracked pose."""
        return self.fit < CONTRADICTED_BELOW

    def _find(self, odometry: Odometry, seconds: float) -> None:
        """Go on with the search; track the pose that it finds, unless it is tracked already."""
        frame = self._search.go_on(seconds)
        if frame is None:
            return
        pose = frame.compose(odometry.pose)
        if self.tracking:
            tracked = self.filter.pose
            within = place_probabilities.probability_within(self.filter.pose_covariance)
            needed = 0.0 if within < LOST_BELOW else _CLEARLY_BETTER
            if (
                are_close(pose, tracked)
                or self._search.advantage(pose, tracked, odometry.pose) < needed
            ):
                return
        self._track(pose, _SEARCH_XY, _SEARCH_YAW, odometry)

    def _track(self, pose: Pose, xy: float, yaw: float, odometry: Odometry) -> None:
        self.tracking = True
        self.fit = max(self.params.doubt_below, 0.5)
        self.filter.initialize(pose, np.diag([xy**2, xy**2, yaw**2]), odometry)

    def _belief(self, posterior: place_probabilities.PlacePosterior, odometry: Odometry) -> Belief:
        if not self.tracking:
            unknown: Array = np.diag([1e4, 1e4, 10.0])
            return Belief(
                odometry.time,
                Pose(0.0, 0.0, 0.0),
                unknown,
                confidence=0.0,
                lost=True,
                hypotheses=self._search.hypotheses,
            )
        pose, covariance = self.filter.pose, self.filter.pose_covariance
        within = place_probabilities.probability_within(covariance)
        return Belief(
            odometry.time,
            pose,
            covariance,
            posterior.at(pose, covariance),
            within * max(self._trust(self.fit), _MIN_TRUST),
            within < LOST_BELOW,
            updates=self.filter.updates,
            hypotheses=self._search.hypotheses,
        )
