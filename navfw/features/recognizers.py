"""The recognisers of landmarks in single images.

``aruco``: square markers (OpenCV's ArUco, 4 x 4 modules). ``none``: for dead reckoning.

The orientation of a small square is ambiguous (two solutions), but its range is not: both of its
sides are vertical, and the length of a side over the difference of its ends' slopes is its
horizontal distance, at any orientation (METHOD 4.6: range and bearing only).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.features.landmark_appearance import identity_of, marker_dictionary
from navfw.interfaces import FeatureRecognizer
from navfw.numerics import Array
from navfw.numerics.functions import arctan2
from navfw.numerics.products import product
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, LandmarkDetection
from navfw.topomap import TopoMap

CORNER_SIGMA = 0.4  # chosen
"""Standard deviation of a corner [px]."""
MIN_SIDE = 10.0  # chosen
"""Least height of a marker [px]."""

_STEP = 0.25  # chosen
"""Step of the numerical derivative [px]."""
_MAX_LEAN = 0.25  # chosen
"""Largest lean of a side (horizontal over vertical extent): camera and plates are upright."""
_BEARING_FLOOR = math.radians(0.3)  # chosen
_RANGE_FLOOR = 0.01  # chosen
"""Standard deviations of errors other than the corners': camera mount, focal length, plate. Bearing
in rad, range as a share."""


def landmark_sizes(topo_map: TopoMap, kind: str) -> Mapping[int, float]:
    """Return the sides [m] of the map's landmarks of ``kind``, by id."""
    marks = topo_map.landmarks.values()
    return {mark.id: mark.size for mark in marks if mark.kind == kind}


def locate(corners: Array, side: float, camera: CameraModel) -> Array:
    """Compute bearing [rad] and range [m] in base_link (..., 2) of the centres of upright squares.

    ``corners`` (..., 4, 2) [px, relative to the principal point] are top left, top right, bottom
    right, bottom left in the image; ``side`` [m] is the squares' side.
    """
    ahead = np.full((*corners.shape[:-1], 1), camera.focal)
    rays = product(np.concatenate([corners, ahead], axis=-1), camera.base_from_camera.T)
    level = np.hypot(rays[..., 0], rays[..., 1])
    slopes = rays[..., 2] / level
    directions = rays[..., :2] / level[..., None]
    # left side: corners 0 and 3; right side: corners 1 and 2
    drop = np.maximum(slopes[..., :2] - slopes[..., :1:-1], 1e-6)
    along = 0.5 * (directions[..., :2, :] + directions[..., :1:-1, :])
    points = (side / drop)[..., None] * along
    middle = points.mean(axis=-2)
    x = middle[..., 0] + camera.mount_forward
    return np.stack([arctan2(middle[..., 1], x), np.hypot(x, middle[..., 1])], axis=-1)


def locate_with_covariance(
    corners: Array, side: float, camera: CameraModel, sigma: float
) -> tuple[Array, Array]:
    """Compute bearing [rad] and range [m] (2,) of a square as ``locate``, and covariance (2, 2).

    ``sigma`` [px] is the standard deviation of each coordinate of ``corners`` (4, 2).
    """
    shifts = _STEP * np.eye(8).reshape(8, 4, 2)
    varied = locate(np.concatenate([corners[None], corners + shifts]), side, camera)
    located = varied[0]
    jacobian = (varied[1:] - located) / _STEP
    covariance = product(sigma**2 * jacobian.T, jacobian)
    covariance += np.diag([_BEARING_FLOOR**2, (_RANGE_FLOOR * located[1]) ** 2])
    return located, covariance


def is_upright(corners: Array) -> bool:
    """Check whether corners (4, 2) can be those of an upright square seen from its front."""
    left, right = corners[3] - corners[0], corners[2] - corners[1]
    leans = abs(left[0]) > _MAX_LEAN * left[1] or abs(right[0]) > _MAX_LEAN * right[1]
    return bool(not leans and corners[0, 0] < corners[1, 0] and corners[3, 0] < corners[2, 0])


def square_detection(
    time: float,
    kind: str,
    number: int,
    pixels: Array,
    side: float,
    camera: CameraModel,
    sigma: float,
) -> LandmarkDetection:
    """Make the detection of a landmark with corners ``pixels`` (4, 2) [px, from the image's first].

    ``side`` [m] is the landmark's side, ``sigma`` [px] the corners' standard deviation.
    """
    corners = pixels - 0.5 * np.array([camera.width - 1, camera.height - 1])
    (bearing, away), covariance = locate_with_covariance(corners, side, camera, sigma)
    return LandmarkDetection(
        time, identity_of(kind, number), float(bearing), float(away), covariance
    )


class Aruco(FeatureRecognizer):
    """Detects square markers of 4 x 4 modules, with the bearing and range of each."""

    name: ClassVar[str] = "aruco"
    landmark_frames: ClassVar[bool] = True

    class Params(FeatureRecognizer.Params):
        """Size of the dictionary, and side of markers that are not in the map."""

        ids: Literal[50, 100, 250, 1000] = Field(
            100, description="size of the dictionary: fewer ids give fewer confusions"
        )
        size: float = Field(
            0.25, gt=0.0, le=3.0, description="side of markers that are not in the map [m]"
        )

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
        self._settings = settings
        self._detector = cv2.aruco.ArucoDetector(marker_dictionary(self.params.ids), settings)

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map, which gives the markers' sizes."""
        self._sizes = landmark_sizes(topo_map, "aruco")

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """Detect the upright markers in ``frame``, by id; of two with one id, the higher one."""
        height, width = frame.image.shape
        # a marker's outline has 2 * MIN_SIDE px; smaller ones cost 160 x 120 px 20 times the time
        self._settings.minMarkerPerimeterRate = max(0.03, 1.6 * MIN_SIDE / max(height, width))
        self._detector.setDetectorParameters(self._settings)
        quads, ids, _ = self._detector.detectMarkers(frame.image)
        if ids is None or not len(ids):
            return ()
        largest: dict[int, tuple[float, LandmarkDetection]] = {}
        camera = self.robot.landmark_view.model_copy(update={"width": width, "height": height})
        for quad, number in zip(quads, map(int, np.ravel(ids)), strict=True):
            pixels = np.asarray(quad, np.float64).reshape(4, 2)
            tall = float(min(pixels[3, 1] - pixels[0, 1], pixels[2, 1] - pixels[1, 1]))
            if tall < MIN_SIDE or not is_upright(pixels):
                continue
            if number in largest and largest[number][0] >= tall:
                continue
            side = self._sizes.get(number, self.params.size)
            largest[number] = (
                tall,
                square_detection(frame.time, "aruco", number, pixels, side, camera, CORNER_SIGMA),
            )
        return tuple(largest[number][1] for number in sorted(largest))


class NoFeatures(FeatureRecognizer):
    """Detects nothing."""

    name: ClassVar[str] = "none"

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """Return no detections, whatever ``frame`` shows."""
        del frame
        return ()
