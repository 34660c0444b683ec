"""The recogniser ``aruco``: square markers (OpenCV's ArUco, 4 x 4 modules) in single images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.features.landmark_appearance import marker_dictionary
from navfw.features.square_localization import is_upright, landmark_sizes, square_detection
from navfw.interfaces import FeatureRecognizer
from navfw.robot import RobotModel
from navfw.signals import Frame, LandmarkDetection
from navfw.topomap import TopoMap


class Aruco(FeatureRecognizer):
    """Detects square markers of 4 x 4 modules, with the bearing and range of each."""

    name: ClassVar[str] = "aruco"
    landmark_frames: ClassVar[bool] = True

    class Params(FeatureRecognizer.Params):
        """Dictionary, assumed size, corner accuracy and least size in the image."""

        ids: Annotated[
            Literal[50, 100, 250, 1000],
            Field(description="size of the dictionary: fewer ids give fewer confusions"),
        ] = 100
        size: Annotated[
            float, Field(gt=0.0, le=3.0, description="side of markers that are not in the map [m]")
        ] = 0.25
        corner_sigma: Annotated[
            float, Field(gt=0.0, le=5.0, description="standard deviation of a corner [px]")
        ] = 0.4
        smallest: Annotated[
            float, Field(ge=4.0, le=200.0, description="least height of a marker [px]")
        ] = 10.0

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._sizes: Mapping[int, float] = {}
        settings = cv2.aruco.DetectorParameters()
        # at the default (larger) value the outline of a large marker's white rim can replace that
        # of the marker; below 0.03 an outline within the black frame can (range 15 % too large)
        settings.minMarkerDistanceRate = 0.03
        # without refinement dark squares shrink with distance: range 5 % too large at 4 m
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        settings.cornerRefinementWinSize = 3
        self._detector = cv2.aruco.ArucoDetector(marker_dictionary(self.params.ids), settings)

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map, which gives the markers' sizes."""
        self._sizes = landmark_sizes(topo_map, "aruco")

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """All upright markers in ``frame``, ordered by id; of two with one id the larger."""
        quads, ids, _ = self._detector.detectMarkers(frame.image)
        if ids is None or not len(ids):
            return ()
        largest: dict[int, tuple[float, LandmarkDetection]] = {}
        height, width = frame.image.shape
        camera = self.robot.landmark_view.model_copy(update={"width": width, "height": height})
        for quad, number in zip(quads, map(int, np.ravel(ids)), strict=True):
            pixels = np.asarray(quad, np.float64).reshape(4, 2)
            tall = float(min(pixels[3, 1] - pixels[0, 1], pixels[2, 1] - pixels[1, 1]))
            if tall < self.params.smallest or not is_upright(pixels):
                continue
            if number in largest and largest[number][0] >= tall:
                continue
            side = self._sizes.get(number, self.params.size)
            largest[number] = (
                tall,
                square_detection(
                    frame.time, "aruco", number, pixels, side, camera, self.params.corner_sigma
                ),
            )
        return tuple(largest[number][1] for number in sorted(largest))
