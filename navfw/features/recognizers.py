"""The recognisers of landmarks in single images.

``aruco``: square markers (OpenCV's ArUco, 4 x 4 modules). ``posters``: pictures, found by ORB
features, ratio test and homography. ``landmarks``: both of them. ``none``: for dead reckoning.

The orientation of a small square is ambiguous (two solutions), but its range is not: both of its
sides are vertical, and the length of a side over the difference of its ends' slopes is its
horizontal distance, at any orientation (METHOD 4.6: range and bearing only).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.config.image_file import read_image
from navfw.features.landmark_appearance import identity_of, marker_dictionary, poster_image
from navfw.interfaces import FeatureRecognizer
from navfw.numerics import Array, Image
from navfw.numerics.functions import arctan2
from navfw.numerics.products import product
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, LandmarkDetection
from navfw.topomap import TopoMap

CORNER_SIGMA = 0.4
"""Standard deviation of a corner [px]."""
MIN_SIDE = 10.0
"""Least height of a marker [px]."""

_STEP = 0.25
"""Step of the numerical derivative [px]."""
_MAX_LEAN = 0.25
"""Largest lean of a side (horizontal over vertical extent): camera and plates are upright."""
_BEARING_FLOOR = math.radians(0.3)
_RANGE_FLOOR = 0.01
"""Standard deviations of errors other than the corners': camera mount, focal length, plate. Bearing
in rad, range as a share."""


def landmark_sizes(topo_map: TopoMap, kind: str) -> Mapping[int, float]:
    """Sides [m] of the map's landmarks of ``kind``, by id."""
    marks = topo_map.landmarks.values()
    return {mark.id: mark.size for mark in marks if mark.kind == kind}


def locate(corners: Array, side: float, camera: CameraModel) -> Array:
    """Bearing [rad] and range [m] in base_link (..., 2) of the centres of upright squares.

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
    """Bearing and range (2,) of one square, and their covariance (2, 2).

    ``sigma`` [px] is one standard deviation of each coordinate of ``corners`` (4, 2).
    """
    shifts = _STEP * np.eye(8).reshape(8, 4, 2)
    varied = locate(np.concatenate([corners[None], corners + shifts]), side, camera)
    located = varied[0]
    jacobian = (varied[1:] - located) / _STEP
    covariance = product(sigma**2 * jacobian.T, jacobian)
    covariance += np.diag([_BEARING_FLOOR**2, (_RANGE_FLOOR * located[1]) ** 2])
    return located, covariance


def is_upright(corners: Array) -> bool:
    """Whether corners (4, 2) can be those of an upright square viewed from its front."""
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
    """The detection of a landmark with corners ``pixels`` (4, 2) [px, from the image's corner].

    ``side`` [m] is the landmark's side, ``sigma`` [px] the corners' standard deviation.
    """
    corners = pixels - 0.5 * np.array([camera.width - 1, camera.height - 1])
    (bearing, away), covariance = locate_with_covariance(corners, side, camera, sigma)
    return LandmarkDetection(
        time, identity_of(kind, number), float(bearing), float(away), covariance
    )


_SIDES = (160, 64)
"""Sides [px] of the templates: one for near, one for distant posters."""
_ENLARGED = 2
"""Enlargement of frames: ORB's patches are 31 px wide, like distant posters. At this
factor OpenCV's cubic interpolation is exact on every processor; at others it is not."""
_FRAME_FEATURES = 800
_TEMPLATE_FEATURES = 250
"""Number of features extracted from a frame, and from a template at each size."""
_INLIER_DISTANCE = 3.0
"""Largest reprojection error [px, enlarged] of an inlier of the homography."""


@dataclass(frozen=True, slots=True)
class _PosterTemplate:
    """Features of one poster: points (N, 2) as shares of its side, descriptors (N, 32)."""

    number: int
    points: Array
    descriptors: Image


class Posters(FeatureRecognizer):
    """Detects the posters of the map and of files, with the bearing and range of each."""

    name: ClassVar[str] = "posters"
    landmark_frames: ClassVar[bool] = True

    class Params(FeatureRecognizer.Params):
        """Matching thresholds, and pictures of posters that are not generated from their id."""

        images: Annotated[
            Mapping[Annotated[int, Field(ge=0, le=1_000_000)], str],
            Field(description="files of square posters, by id; others are generated from the id"),
        ] = {}
        size: Annotated[
            float, Field(gt=0.0, le=10.0, description="side of posters that are not in the map [m]")
        ] = 0.5
        ratio: Annotated[
            float,
            Field(gt=0.0, le=1.0, description="largest ratio of best to second match distance"),
        ] = 0.8
        inliers: Annotated[
            int, Field(ge=8, le=500, description="least number of inliers of the homography")
        ] = 12
        corner_sigma: Annotated[
            float, Field(gt=0.0, le=20.0, description="standard deviation of a corner [px]")
        ] = 1.0

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._orb = cv2.ORB.create(nfeatures=_FRAME_FEATURES, edgeThreshold=12, fastThreshold=10)
        self._template_orb = cv2.ORB.create(
            nfeatures=_TEMPLATE_FEATURES, edgeThreshold=12, fastThreshold=10
        )
        self._matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
        self._own = {
            number: read_image(file, cv2.IMREAD_GRAYSCALE).astype(np.uint8, copy=False)
            for number, file in self.params.images.items()
        }
        self._templates: dict[int, _PosterTemplate] = {}
        self._sizes: Mapping[int, float] = {}
        self._wanted: tuple[_PosterTemplate, ...] = ()
        self._choose(self._own)

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map, whose posters are detected beside those given as files."""
        self._sizes = landmark_sizes(topo_map, "poster")
        self._choose([*self._own, *self._sizes])

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """All posters in ``frame``, ordered by id."""
        if not self._wanted:
            return ()
        height, width = frame.image.shape
        large = cv2.resize(
            frame.image, (width * _ENLARGED, height * _ENLARGED), interpolation=cv2.INTER_CUBIC
        )
        keypoints, descriptors = self._orb.detectAndCompute(large, None)
        if descriptors is None or len(keypoints) < self.params.inliers:
            return ()
        points = np.array([keypoint.pt for keypoint in keypoints], np.float64)
        camera = self.robot.landmark_view.model_copy(update={"width": width, "height": height})
        detections = []
        for template in self._wanted:
            corners = self._find(template, points, descriptors.astype(np.uint8, copy=False))
            if corners is None:
                continue
            pixels = (corners + 0.5) / _ENLARGED - 0.5
            side = self._sizes.get(template.number, self.params.size)
            sigma = CORNER_SIGMA
            detections.append(
                square_detection(frame.time, "poster", template.number, pixels, side, camera, sigma)
            )
        return tuple(detections)

    def _choose(self, numbers: Sequence[int] | Mapping[int, object]) -> None:
        for number in numbers:
            if number not in self._templates:
                own = self._own.get(number)
                self._templates[number] = self._template(
                    number, poster_image(number) if own is None else own
                )
        self._wanted = tuple(self._templates[number] for number in sorted(set(numbers)))

    def _template(self, number: int, picture: Image) -> _PosterTemplate:
        """Features of a picture at all sizes in ``_SIDES``."""
        points, descriptors = [np.zeros((0, 2))], [np.zeros((0, 32), np.uint8)]
        for side in _SIDES:
            scaled = cv2.resize(picture, (side, side), interpolation=cv2.INTER_AREA)
            keypoints, binary = self._template_orb.detectAndCompute(scaled, None)
            if binary is not None:
                points.append((np.array([k.pt for k in keypoints]) + 0.5) / side)
                descriptors.append(binary.astype(np.uint8, copy=False))
        return _PosterTemplate(number, np.concatenate(points), np.concatenate(descriptors))

    def _find(self, template: _PosterTemplate, points: Array, descriptors: Image) -> Array | None:
        """Corners (4, 2) [px] of the poster among the frame's features; None if it is not there."""
        least = self.params.inliers
        if len(template.descriptors) < 2:
            return None
        # templates have several sizes, so one point of the frame can match twice: match from there
        pairs = self._matcher.knnMatch(template.descriptors, descriptors, k=2)
        good = [
            pair[0]
            for pair in pairs
            if len(pair) == 2 and pair[0].distance < self.params.ratio * pair[1].distance
        ]
        if len(good) < least:
            return None
        template_points = template.points[[match.queryIdx for match in good]]
        frame_points = points[[match.trainIdx for match in good]]
        homography, mask = cv2.findHomography(
            template_points, frame_points, cv2.USAC_DEFAULT, _INLIER_DISTANCE
        )
        if homography is None or int(np.count_nonzero(mask)) < least:
            return None
        # count points of the frame matched twice only once
        agreed = {tuple(point) for point in np.rint(frame_points[np.ravel(mask) > 0]).tolist()}
        square = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
        corners = cv2.perspectiveTransform(square, homography)[0].astype(np.float64)
        return corners if len(agreed) >= least and _plausible(corners) else None


def _plausible(corners: Array) -> bool:
    """Whether corners (4, 2) can be those of an upright square viewed from its front."""
    if not (np.isfinite(corners).all() and is_upright(corners)):
        return False
    left, right = corners[3, 1] - corners[0, 1], corners[2, 1] - corners[1, 1]
    width = 0.5 * (corners[1, 0] - corners[0, 0] + corners[2, 0] - corners[3, 0])
    sides = 0.5 < left / right < 2.0 and 0.15 < width / max(left, right) < 1.6
    return bool(sides and min(left, right) > 10.0)


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
