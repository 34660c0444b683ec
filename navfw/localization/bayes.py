"""The localiser ``bayes``: a discrete Bayes filter over places and passages (METHOD 4.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

from pydantic import Field

from navfw.interfaces import Localizer
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_model import LandmarkExistence, LandmarkObserver
from navfw.localization.place_probabilities import observed_situations, situation_table
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose
from navfw.topomap import TopoMap


class Bayes(Localizer):
    """Probability of every cell and heading of the map, by odometry, landmarks and OFFIS.

    Finds an unknown start; its pose is as coarse as its cells and headings. The belief is lost
    until enough of the probability lies at one pose that more than one landmark supports.
    """

    name: ClassVar[str] = "bayes"

    class Params(DiscreteParams, Localizer.Params):
        """The lattice, and the landmarks' accuracy and prior existence probability."""

        map_sigma: Annotated[
            float,
            Field(ge=0.0, le=10.0, description="sigma of the landmarks' mapped positions [m]"),
        ] = 0.03
        prior: Annotated[
            float,
            Field(gt=0.0, lt=1.0, description="prior probability that a landmark is where mapped"),
        ] = 0.85
        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which the belief is lost")
        ] = 0.5

    params: Params

    _map: TopoMap | None = None

    def reset(self) -> None:
        """Back to the state before ``start``."""
        self._map = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame), or anywhere when None."""
        self._map = topo_map
        self._observer = LandmarkObserver(topo_map, self.params.map_sigma)
        existence = LandmarkExistence(self.params.prior)
        table = situation_table(self.params.situations)
        self.filter = DiscreteFilter(topo_map, self.params, self.params.prior, existence, table)
        self.filter.initialize(pose, odometry)
        self._known_start = pose is not None
        self._updates = 0

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and, where there are any, percept and detections."""
        if self._map is None:
            raise RuntimeError("start() comes before update()")
        self.filter.predict(odometry)
        self.filter.observe_situations(observed_situations(percept))
        observations = self._observer.observe(odometry, detections)
        self.filter.observe(observations)
        self._updates += len(observations)
        cluster = self.filter.cluster
        support = 1.0 if self._known_start else self.filter.support_probability(cluster.pose)
        confidence = cluster.mass * support
        return Belief(
            odometry.time,
            cluster.pose,
            cluster.spread,
            self.filter.places,
            confidence,
            confidence < self.params.lost_below,
            self._updates,
        )
