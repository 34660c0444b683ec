"""The localiser `bayes`: a discrete Bayes filter over places and passages (METHOD 4.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

from pydantic import Field

from navfw.interfaces import Localizer
from navfw.localization.discrete_filter import DiscreteFilter, DiscreteParams
from navfw.localization.landmark_existence import LandmarkExistence
from navfw.localization.landmark_observations import Looks
from navfw.localization.situation_model import heard, situation_table
from navfw.signals import Belief, LandmarkDetection, Odometry, Percept, Pose
from navfw.topomap import TopoMap

__all__ = ["Bayes"]


class Bayes(Localizer):
    """Weighs every place, passage and direction of the map by odometry, landmarks and OFFIS.

    Finds an unknown start; its pose is as coarse as its cells and directions are. It says that it
    is lost until enough of the probability lies at one pose that more than one landmark supports.
    """

    name: ClassVar[str] = "bayes"

    class Params(DiscreteParams, Localizer.Params):
        """The lattice, and how much landmarks are trusted."""

        placed: Annotated[
            float, Field(ge=0.0, description="how exactly the map has its landmarks [m]")
        ] = 0.03
        prior: Annotated[
            float, Field(gt=0.0, lt=1.0, description="share of landmarks that stand where mapped")
        ] = 0.85
        lost_below: Annotated[
            float, Field(ge=0.0, lt=1.0, description="confidence below which it is lost")
        ] = 0.5

    params: Params

    _map: TopoMap | None = None

    def reset(self) -> None:
        """Forget map, start and everything driven since."""
        self._map = None

    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Begin at ``pose`` [map frame], or anywhere."""
        self._map = topo_map
        self._looks = Looks(topo_map, self.params.placed)
        trust = LandmarkExistence(self.params.prior)
        table = situation_table(self.params.situations)
        self.filter = DiscreteFilter(topo_map, self.params, self.params.prior, trust, table)
        self.filter.begin(pose, odometry)
        self._known_start = pose is not None
        self._updates = 0
        self._seen: object = None
        self._places: Mapping[str, float] = {}

    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and, where there are any, percept and detections."""
        if self._map is None:
            raise RuntimeError("start() comes before update()")
        self.filter.advance(odometry, heard(percept))
        looks = self._looks.hear(odometry, detections)
        self.filter.see(looks)
        self._updates += len(looks)
        cluster = self.filter.cluster
        if self._seen is not self.filter.version:
            self._seen, self._places = self.filter.version, self.filter.places
        evidence = 1.0 if self._known_start else self.filter.evidence(cluster.pose)
        confidence = cluster.mass * evidence
        return Belief(
            odometry.time,
            cluster.pose,
            cluster.spread,
            self._places,
            confidence,
            confidence < self.params.lost_below,
            self._updates,
        )
