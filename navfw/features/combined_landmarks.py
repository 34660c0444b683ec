"""The recognisers ``landmarks``: markers and posters; and ``none``, for dead reckoning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

from pydantic import Field

from navfw.features.aruco import Aruco
from navfw.features.posters import Posters
from navfw.interfaces import FeatureRecognizer
from navfw.robot import RobotModel
from navfw.signals import Frame, LandmarkDetection
from navfw.topomap import TopoMap


class Landmarks(FeatureRecognizer):
    """Detects markers and posters; without posters in the map only markers cost time."""

    name: ClassVar[str] = "landmarks"
    landmark_frames: ClassVar[bool] = True

    class Params(FeatureRecognizer.Params):
        """The parameters of both recognisers."""

        aruco: Annotated[Aruco.Params, Field(description="of markers")] = Aruco.Params()
        posters: Annotated[Posters.Params, Field(description="of posters")] = Posters.Params()

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._recognizers: tuple[FeatureRecognizer, ...] = (
            Aruco(robot, self.params.aruco),
            Posters(robot, self.params.posters),
        )

    def reset(self) -> None:
        """Reset both recognisers."""
        for recognizer in self._recognizers:
            recognizer.reset()

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map, which gives the landmarks' sizes and the posters to detect."""
        for recognizer in self._recognizers:
            recognizer.set_map(topo_map)

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """All markers, then all posters, in ``frame``."""
        return tuple(
            detection
            for recognizer in self._recognizers
            for detection in recognizer.recognize(frame)
        )


class NoFeatures(FeatureRecognizer):
    """Detects nothing."""

    name: ClassVar[str] = "none"

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """No landmarks in any ``frame``."""
        del frame
        return ()
