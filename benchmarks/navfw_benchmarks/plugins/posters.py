"""Posters: landmarks that are pictures, found by ORB features, ratio test and homography."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, ClassVar

import cv2
import numpy as np
from pydantic import Field

from navfw import (
    Array,
    FeatureRecognizer,
    Frame,
    Image,
    LandmarkDetection,
    LandmarkKind,
    RobotModel,
    TopoMap,
)
from navfw.config.image_file import read_image
from navfw.features.recognizers import Aruco, is_upright, landmark_sizes, square_detection

_POSTER = 256
"""Texels along a poster's side."""
_SHAPES = 70
"""Number of shapes on a poster."""
_SIDES = (160, 64)
"""Sides [px] of the templates: one for near, one for distant posters."""
_ENLARGED = 2
"""Factor by which frames are enlarged: ORB's patches are 31 px wide, like distant posters. At this
factor OpenCV's cubic interpolation is exact on every processor; at others it is not."""
_FRAME_FEATURES, _TEMPLATE_FEATURES = 800, 250
"""Number of features extracted from a frame, and from a template at each size."""
_INLIERS, _INLIER_DISTANCE = 12, 3.0
"""Least number of inliers of the homography; their largest reprojection error [px, enlarged]."""
_RATIO = 0.8
"""Largest ratio of best to second match distance."""
_SIDE = 0.5
"""Side of posters that are not in the map [m]."""
_CORNER_SIGMA = 1.0
"""Standard deviation of a corner [px]."""


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
        """Pictures of posters that are not generated from their id."""

        images: Annotated[
            Mapping[Annotated[int, Field(ge=0, le=1_000_000)], str],
            Field(description="files of square posters, by id; others are generated from the id"),
        ] = {}

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
        if descriptors is None or len(keypoints) < _INLIERS:
            return ()
        points = np.array([keypoint.pt for keypoint in keypoints], np.float64)
        camera = self.robot.landmark_view.model_copy(update={"width": width, "height": height})
        detections = []
        for template in self._wanted:
            corners = self._find(template, points, descriptors.astype(np.uint8, copy=False))
            if corners is None:
                continue
            pixels = (corners + 0.5) / _ENLARGED - 0.5
            side = self._sizes.get(template.number, _SIDE)
            detections.append(
                square_detection(
                    frame.time, "poster", template.number, pixels, side, camera, _CORNER_SIGMA
                )
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
        if len(template.descriptors) < 2:
            return None
        # templates have several sizes, so one point of the frame can match twice: match from there
        pairs = self._matcher.knnMatch(template.descriptors, descriptors, k=2)
        good = [
            pair[0]
            for pair in pairs
            if len(pair) == 2 and pair[0].distance < _RATIO * pair[1].distance
        ]
        if len(good) < _INLIERS:
            return None
        template_points = template.points[[match.queryIdx for match in good]]
        frame_points = points[[match.trainIdx for match in good]]
        homography, mask = cv2.findHomography(
            template_points, frame_points, cv2.USAC_DEFAULT, _INLIER_DISTANCE
        )
        if homography is None or int(np.count_nonzero(mask)) < _INLIERS:
            return None
        # count points of the frame matched twice only once
        agreed = {tuple(point) for point in np.rint(frame_points[np.ravel(mask) > 0]).tolist()}
        square = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
        corners = cv2.perspectiveTransform(square, homography)[0].astype(np.float64)
        return corners if len(agreed) >= _INLIERS and _plausible(corners) else None


def _plausible(corners: Array) -> bool:
    """Whether corners (4, 2) can be those of an upright square viewed from its front."""
    if not (np.isfinite(corners).all() and is_upright(corners)):
        return False
    left, right = corners[3, 1] - corners[0, 1], corners[2, 1] - corners[1, 1]
    width = 0.5 * (corners[1, 0] - corners[0, 0] + corners[2, 0] - corners[3, 0])
    sides = 0.5 < left / right < 2.0 and 0.15 < width / max(left, right) < 1.6
    return bool(sides and min(left, right) > 10.0)


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


class Poster(LandmarkKind):
    """A picture generated from its id, without a rim; its size is the picture's side."""

    name: ClassVar[str] = "poster"

    def plate_image(self, number: int) -> Image:
        """The picture (N, N), luminance."""
        return poster_image(number)


@lru_cache(maxsize=256)
def poster_image(number: int) -> Image:
    """Luminance (256, 256), read-only, of a poster: discs, bars and polygons over smooth noise.

    Seeded by ``number`` alone. Shapes from a thirtieth to a third of the side give features at
    every distance; the noise makes the surroundings of every feature different.
    """
    rng = np.random.default_rng([number, 20090213])
    canvas = _smooth_noise(rng)
    for shape in range(_SHAPES):
        span = 0.34 * (0.035 / 0.34) ** (shape / (_SHAPES - 1))
        grey = float(rng.uniform(15.0, 240.0))
        _shape(canvas, rng, 0.5 * span * _POSTER, grey)
    canvas += 12.0 * cv2.resize(rng.standard_normal((64, 64)), (_POSTER, _POSTER))
    image: Image = np.clip(np.rint(cv2.GaussianBlur(canvas, (0, 0), 1.0)), 0, 255).astype(np.uint8)
    image.setflags(write=False)
    return image


def _smooth_noise(rng: np.random.Generator) -> Array:
    canvas = np.full((_POSTER, _POSTER), 128.0)
    for cells in (3, 6, 12):
        waves = rng.standard_normal((cells, cells))
        canvas += (
            60.0 / cells**0.5 * cv2.resize(waves, (_POSTER, _POSTER), interpolation=cv2.INTER_CUBIC)
        )
    return canvas


def _shape(canvas: Array, rng: np.random.Generator, radius: float, grey: float) -> None:
    """Draw one disc, bar or polygon of ``radius`` [px] at a random position."""
    middle = rng.uniform(0.0, _POSTER, 2)
    style = int(rng.integers(4))
    if style == 0:
        cv2.circle(canvas, np.rint(middle).astype(int).tolist(), max(2, round(radius)), grey, -1)
        return
    corners = 4 if style == 1 else int(rng.integers(3, 7))
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    reach = radius * rng.uniform(0.6, 1.3, corners)
    if style == 1:  # a bar
        angles = rng.uniform(0.0, np.pi) + np.array([0.25, np.pi - 0.25, np.pi + 0.25, -0.25])
        reach = np.full(4, 1.2 * radius)
    points = middle + reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    cv2.fillPoly(canvas, [np.rint(points).astype(np.int32)], grey)
