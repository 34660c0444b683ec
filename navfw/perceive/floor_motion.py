"""Find the floor by its motion: a homography of known form (METHOD 2.8).

A floor at the height h below a camera that moves by ``rotation`` and ``direction * baseline`` maps
image points by a homography with one unknown, baseline / h, besides the camera's pitch. The past
image is warped by each of a set of values, and the differences of the two images show which one is
right. All pixels below the horizon count together, so that a floor of little texture is found, and
edges along which local flow cannot be measured do no harm. Nor does a glossy floor: a cell may show
a mirror image, which moves like something below the floor.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, Image
from navfw.numerics.arrays import Floats, Mask
from navfw.robot import CameraModel
from navfw.signals import CameraMotion, FlowField

NOISE = 3.0
"""Standard deviation of the difference of two images of the same surface [grey levels]."""

SMOOTHING = 1.0
"""Standard deviation of the smoothing before images are compared [px]."""

OUTSIDE = -1000.0
"""Grey level given to pixels that the past image does not contain."""

HIDDEN = 0.2
"""Share of such pixels from which a cell counts as not seen."""

UNSEEN = 4.0
"""Variance [NOISE^2] given to a cell that is not seen: a difference of twice the noise."""


class PlaneWarp:
    """Compares two working images (height, width), between which the camera moved by ``motion``.

    ``focal`` [px] is the focal length, ``grid`` the (rows, columns) by which they are compared.
    """

    def __init__(
        self, now: Image, past: Image, motion: CameraMotion, focal: float, grid: tuple[int, int]
    ) -> None:
        self._now, self._past = _smooth(now), _smooth(past)
        self._motion, self._focal, self._grid = motion, focal, grid

    def difference(self, normal: Array, ratio: float) -> Array:
        """Return the variance (rows, cols) [NOISE^2] that a plane leaves unexplained in each cell.

        ``normal`` (3,) is the plane's unit normal, away from the camera, in camera axes; ``ratio``
        is the baseline over the distance of the plane. A difference in brightness of a whole cell
        is ignored.
        """
        height, width = self._now.shape
        direction = self._motion.translation / max(self._motion.baseline, 1e-12)
        plane = self._motion.rotation.T @ (np.eye(3) + ratio * np.outer(direction, normal))
        camera = np.array(
            [
                [self._focal, 0.0, 0.5 * (width - 1)],
                [0.0, self._focal, 0.5 * (height - 1)],
                [0.0, 0.0, 1.0],
            ]
        )
        warped = cv2.warpPerspective(
            self._past,
            camera @ plane @ np.linalg.inv(camera),
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(OUTSIDE,),
        )
        outside = np.asarray(warped < 0.5 * OUTSIDE)
        off = _cells_of(np.where(outside, 0.0, self._now - warped), self._grid)
        variance = (off * off).mean(axis=(1, 3)) - off.mean(axis=(1, 3)) ** 2
        unseen = _cells_of(outside, self._grid).mean(axis=(1, 3)) > HIDDEN
        return np.where(unseen, UNSEEN, variance / NOISE**2)

    def mean(self) -> Array:
        """Return the mean grey level (rows, cols) of each cell of the current image."""
        mean: Array = _cells_of(self._now, self._grid).mean(axis=(1, 3))
        return mean


def _cells_of(image: npt.NDArray[np.generic], grid: tuple[int, int]) -> Array:
    """Reshape ``image`` to cells of a grid: (rows, height of a cell, cols, width of a cell)."""
    rows, cols = grid
    height, width = image.shape
    cells: Array = image.astype(np.float64)
    return cells.reshape(rows, height // rows, cols, width // cols)


def _smooth(image: Image) -> Floats:
    blurred = cv2.GaussianBlur(image.astype(np.float32), (0, 0), SMOOTHING)
    return np.asarray(blurred, dtype=np.float32)


_PITCHES = np.radians(np.arange(-10.0, 32.5, 2.5))
"""Pitches of the camera that are tried [rad], nose down."""

_RATIOS = np.concatenate([[0.0], np.geomspace(0.02, 2.5, 28)])
"""Ratios of baseline to height that are tried; 0 is a floor too far away to move."""

_ELEVATION_SIGMA = math.radians(5.0)
"""Standard deviation of the angle between a heading and the floor's plane [rad]."""

_LOW_ROWS = 0.42
"""Share of the image's rows, from the lowest, that ratio and pitch are chosen by."""

MIRRORED = 0.3
"""Prior probability that a cell of the floor shows the mirror image of something."""

_MAX_MIRRORED = 0.5
"""Largest nearness of a mirror image, as a share of the floor's in that cell: mirrored objects are
at least as high above the floor as the camera."""

MIN_FALL = 0.12
"""Least descent of a ray per depth that counts as below the horizon, as pitches are inexact."""

_MIN_GAIN = 4.0
"""Least gain in log likelihood of a moving floor over a floor that does not move."""

_WALL_MARGIN, _FOOT_MARGIN = 5.0, (3.0, 1.0)
"""Log likelihoods by which a wall ahead must explain images better than a floor to exclude it, and
a floor of unusual or usual speed in front of that wall better than the wall alone, to be there."""

_FITTING = 2.0
"""Largest variance [NOISE^2] of the difference of a cell that a plane explains."""

_MIN_PROVEN = 2
"""Least number of cells whose texture moves like a floor."""

_SPEED_SIGMA, _SPEED_JUMP = 0.3, 8.0
"""Standard deviation of the logarithm of the speed about that of earlier pairs, and the largest
cost of a jump of it in log likelihood."""

USUAL = 0.4
"""Largest change of the logarithm of the speed with which a floor is accepted without proof."""

MEMORY = 9
"""Number of earlier pairs whose median speed is expected."""

MIN_PAIRS = 5
"""Number of pairs with a floor from which its pitch is known, and it is expected to stay."""

_REVIEW = 5
"""Number of pairs after which all pitches are tried again."""

ALIKE = 30.0
"""Largest difference of the mean grey levels of neighbouring cells of the same floor."""

_PROVEN, REACHED = 0.7, 0.3
"""Confidence of the floor's vectors in cells that prove it, and in the others."""

_SURE = 0.4
"""Largest relative standard deviation of the nearness of an object that hides the floor."""

_LIKE_FLOOR = 1.25
"""Nearness of a cell, relative to the floor's, up to which it may be floor."""

_VECTOR_SIGMA = 0.3
"""Standard deviation of the floor's vectors [px]."""


@dataclass(frozen=True, slots=True)
class FloorMotion:
    """The floor as seen between two images.

    ``ratio`` is baseline / camera height, ``pitch`` [rad] the camera's, nose down. ``cells`` (rows,
    cols) marks cells that show floor, ``proven`` (rows, cols) those whose texture moves like it;
    the others are reached from these through cells that show nothing else.
    """

    ratio: float
    pitch: float
    cells: Mask
    proven: Mask

    def apply(self, flow: FlowField, camera: CameraModel) -> FlowField:
        """Return ``flow`` (derotated) with the floor's vectors in the floor's cells."""
        shift = flow.motion.translation
        fall = camera.fall_per_depth(flow.points, self.pitch)
        nearness = self.ratio * fall / flow.motion.baseline
        lines = flow.points * shift[2] - camera.focal * shift[:2]
        vectors = lines * (nearness / (1.0 + shift[2] * nearness))[..., None]
        hidden = _hidden(flow, lines, nearness, self.cells)
        cells = self.cells & ~hidden
        confidence = np.where(cells, REACHED, np.where(hidden, 0.0, flow.confidence))
        return replace(
            flow,
            vectors=np.where(cells[..., None], vectors, flow.vectors),
            confidence=np.where(self.proven & ~hidden, _PROVEN, confidence),
            sigma=np.where(cells, _VECTOR_SIGMA, flow.sigma),
        )


class FloorFinder:
    """Finds the floor in the pairs of a sequence; ``pitch`` [rad] is None if it is unknown.

    ``lost`` is True if a floor that was seen before is not found in the last pair, though no wall
    ahead hides it.
    """

    def __init__(self, camera: CameraModel, grid: tuple[int, int], pitch: float | None) -> None:
        self._camera = camera
        self._grid = grid
        self._pitches = _PITCHES if pitch is None else np.array([pitch])
        self._evidence = np.zeros(self._pitches.size)
        self._speeds: deque[float] = deque(maxlen=MEMORY)
        self._pairs = self._since_review = 0
        self.lost = False

    @property
    def pitch(self) -> float | None:
        """The most likely pitch [rad], nose down; None while there is too little evidence."""
        if self._pitches.size > 1 and self._pairs < MIN_PAIRS:
            return None
        k = int(self._evidence.argmax())
        if not 0 < k < self._pitches.size - 1:
            return float(self._pitches[k])
        step = float(self._pitches[1] - self._pitches[0])
        return float(self._pitches[k]) + step * _vertex(self._evidence, k)[0]

    def find(self, now: Image, past: Image, motion: CameraMotion) -> FloorMotion | None:
        """Find the floor between two working images; None if there is none. Updates ``lost``."""
        self.lost = False
        warp = PlaneWarp(now, past, motion, self._camera.focal, self._grid)
        self._since_review += 1
        reviewed = self.pitch is None or self._since_review >= _REVIEW
        tried = self._pitches if reviewed else np.array([self.pitch])
        floors = [self._floor_likelihoods(warp, pitch) for pitch in tried.tolist()]
        scores = np.array([np.log(floor).sum(axis=(1, 2)) for floor in floors])
        if tried.size > 1 and (scores.max(axis=1) - scores[:, 0]).max() > _MIN_GAIN:
            self._collect(warp, floors, motion)
        pitch = self.pitch
        if pitch is None:
            return None
        chosen = int(np.abs(tried - pitch).argmin())
        upright = np.array([0.0, -math.sin(pitch), math.cos(pitch)])  # of a wall in front
        walls = self._likelihoods(warp, upright)
        likelihood = _in_front_of(floors[chosen], walls)
        wall, score = np.log(walls).sum(axis=(1, 2)).max(), scores[chosen]
        walled = wall > score.max() + _WALL_MARGIN
        by = likelihood if walled else score
        floor = self._floor(warp, pitch, _peak(by + self._expected(motion.dt)))
        speed = floor.ratio / motion.dt
        if walled and wall > likelihood.max() - _FOOT_MARGIN[self._is_usual(speed)]:
            return None
        if score.max() - score[0] > _MIN_GAIN and int(floor.proven.sum()) >= _MIN_PROVEN:
            self._speeds.append(speed)
        elif not (self._is_usual(speed) and floor.cells.any()):
            self.lost = len(self._speeds) >= MIN_PAIRS
            return None
        return floor

    def without_floor(self, flow: FlowField) -> FlowField:
        """Return ``flow`` with confidence 0 where it may show the floor, or objects on it.

        This is below the horizon, and as far above it as the pitch may be wrong.
        """
        fall = self._camera.fall_per_depth(flow.points, self.pitch or 0.0)
        return replace(flow, confidence=np.where(fall > -MIN_FALL, 0.0, flow.confidence))

    def _collect(self, warp: PlaneWarp, floors: list[Array], motion: CameraMotion) -> None:
        """Add the evidence of a pair for each pitch: of images, and a heading along the floor."""
        walls = self._likelihoods(warp, np.array([0.0, 0.0, 1.0]))
        likelihood = np.array([_best(_in_front_of(floor, walls)) for floor in floors])
        down = float(motion.translation[1]) / max(motion.baseline, 1e-12)
        off = (self._pitches + math.asin(min(max(down, -1.0), 1.0))) / _ELEVATION_SIGMA
        self._evidence += likelihood - likelihood.max() - 0.5 * off * off
        self._pairs += 1
        self._since_review = 0

    def _floor_likelihoods(self, warp: PlaneWarp, pitch: float) -> Array:
        """Return the likelihood (n, rows, cols) of each of _RATIOS for a floor, glossy in parts."""
        plain = self._likelihoods(warp, _level(pitch))
        mirrored = np.array(
            [plain[_MAX_MIRRORED * ratio >= _RATIOS].mean(axis=0) for ratio in _RATIOS]
        )
        return np.asarray((1.0 - MIRRORED) * plain + MIRRORED * mirrored)

    def _likelihoods(self, warp: PlaneWarp, normal: Array) -> Array:
        """Return the likelihood (n, rows, cols) of each of _RATIOS for a plane, in equal cells."""
        lowest = int(_LOW_ROWS * self._grid[0])
        off = [warp.difference(normal, ratio)[-lowest:] for ratio in _RATIOS.tolist()]
        return np.asarray(1.0 / np.sqrt(1.0 + np.array(off)))

    def _expected(self, dt: float) -> Array:
        """Return the log likelihood (n,) of _RATIOS by the speed of earlier pairs."""
        if not self._speeds:
            return np.zeros(_RATIOS.size)
        usual = dt * float(np.median(self._speeds))
        off = np.log(np.maximum(_RATIOS, 0.5 * _RATIOS[1]) / usual) / _SPEED_SIGMA
        return np.asarray(-0.5 * np.minimum(off * off, 2.0 * _SPEED_JUMP))

    def _is_usual(self, speed: float) -> bool:
        """Return whether ``speed`` [heights/s] is about that of earlier pairs."""
        return bool(self._speeds) and abs(math.log(speed / float(np.median(self._speeds)))) < USUAL

    def _floor(self, warp: PlaneWarp, pitch: float, ratio: float) -> FloorMotion:
        normal = _level(pitch)
        moving = warp.difference(normal, ratio)
        others = np.minimum(warp.difference(normal, 0.0), warp.difference(normal, 1.6 * ratio))
        fits = self._below(pitch) & (moving < _FITTING)
        proven = fits & (others > 2.0 * moving + 0.5)
        seeds = proven.copy()
        if self._speeds:  # what fits right in front of the camera, where floor was proven before
            seeds[-1] |= fits[-1]
        return FloorMotion(ratio, pitch, _spread(seeds, fits, warp.mean()), proven)

    def _below(self, pitch: float) -> Mask:
        """Return the cells (rows, cols) below the horizon."""
        rows, cols = self._grid
        y = ((np.arange(rows) + 0.5) / rows - 0.5) * self._camera.height
        fall = self._camera.fall_per_depth(np.stack([np.zeros(rows), y], axis=-1), pitch)
        return np.repeat((fall > MIN_FALL)[:, None], cols, axis=1)


def _hidden(flow: FlowField, lines: Array, floor: Array, cells: Mask) -> Mask:
    """Return cells (rows, cols) that move like floor, but lie below an object that stands on it.

    An object stands on the floor: below it in the image there is no floor farther away. Two cells
    of a column, other than the floor's ``cells``, have to be nearer than ``floor``. A cell below
    them that moves like the floor may be the object. ``lines`` (rows, cols, 2) are the vectors of
    nearness 1, to first order.
    """
    length = np.maximum((lines * lines).sum(axis=-1), 1e-9)
    along = (flow.vectors * lines).sum(axis=-1) / length
    near = along / np.maximum(1.0 - flow.motion.translation[2] * along, 1e-3)
    is_sure = (flow.sigma < _SURE * near * np.sqrt(length)) & (flow.confidence > REACHED)
    objects = np.where(is_sure & (near > floor) & ~cells, near, 0.0)
    first = second = np.zeros(near.shape[1])
    hidden = np.zeros(near.shape, dtype=bool)
    for row, values in enumerate(objects):
        hidden[row] = floor[row] < second
        second = np.maximum(second, np.minimum(first, values))
        first = np.maximum(first, values)
    return np.asarray(hidden & (cells | (near < _LIKE_FLOOR * floor)))


def _level(pitch: float) -> Array:
    """Return the unit normal (3,) of the floor, downward, in camera axes."""
    return np.array([0.0, math.cos(pitch), math.sin(pitch)])


def _in_front_of(floors: Array, walls: Array) -> Array:
    """Return the log likelihood (n,) of each of ``floors`` (n, rows, cols) in front of a wall.

    The wall is the best one of ``walls`` (n, rows, cols). Its foot may be in another row in each
    column, as of furniture.
    """
    floor, wall = np.log(floors)[:, None, ::-1], np.log(walls)[None, :, ::-1]
    gain = np.cumsum(floor - wall, axis=2).max(axis=2)
    together = np.maximum(gain, 0.0).sum(axis=-1) + wall.sum(axis=(2, 3))
    return np.asarray(together.max(axis=1))


def _peak(scores: Array) -> float:
    """Return the best of _RATIOS above 0, refined by a parabola through the best three."""
    k = min(max(int(np.argmax(scores[1:])) + 1, 2), len(scores) - 2)
    return float(_RATIOS[k] * (_RATIOS[3] / _RATIOS[2]) ** _vertex(scores, k)[0])


def _best(scores: Array) -> float:
    """Return the maximum of ``scores``, also between them."""
    k = min(max(int(np.argmax(scores)), 1), len(scores) - 2)
    return max(float(scores.max()), _vertex(scores, k)[1])


def _vertex(values: Array, k: int) -> tuple[float, float]:
    """Return the vertex of a parabola through three values: steps from the ``k``th, and value."""
    before, top, after = values[k - 1 : k + 2].tolist()
    curve = before - 2.0 * top + after
    step = min(max(0.5 * (before - after) / curve, -1.0), 1.0) if curve < 0.0 else 0.0
    return step, top - 0.25 * (before - after) * step


def _spread(seeds: Mask, fits: Mask, mean: Array) -> Mask:
    """Return ``seeds`` and all cells reached from them over cells that fit and look alike."""
    spread = seeds
    while True:
        grown = spread.copy()
        for cells, neighbours in (
            (np.s_[1:, :], np.s_[:-1, :]),
            (np.s_[:-1, :], np.s_[1:, :]),
            (np.s_[:, 1:], np.s_[:, :-1]),
            (np.s_[:, :-1], np.s_[:, 1:]),
        ):
            alike = np.abs(mean[cells] - mean[neighbours]) < ALIKE
            grown[cells] |= spread[neighbours] & alike & fits[cells]
        if (grown == spread).all():
            return spread
        spread = grown
