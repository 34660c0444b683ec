"""Whether the camera shows the path ahead: the texture in its part of the image."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from navfw.numerics import Array, Image
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import Percept, Sight

REACH = 2.0  # chosen
"""Distance ahead [m] up to which the floor of the path counts."""
_BESIDE = 0.1  # chosen
"""Width of the path beside the body, each side [m]."""
CONFIDENCE = 0.01  # chosen
"""Least confidence of a cell with texture above the noise: it has been matched, however weakly."""
_WEAK, SEEN = 0.6, 0.2  # chosen
"""Shares of the path's cells with texture below which sight is weak, and below which there is none.
Usual texture gives nearly all cells, and edges between surfaces without texture single ones."""
_FAINT = 7.0  # measured
"""Contrast [grey levels] of the path's image below which sight is weak. Usual texture gives 15 and
more, a contrast of 6 under a noise of 2 about 5.5, a contrast of 3 about 3.3."""
_BARE = 0.6  # measured
"""Covariance of neighbouring pixels [grey levels^2] of the path's image below which it shows only
noise. A contrast of 3 gives 1 and more, surfaces without texture 0.5 at most, at any noise."""
CLEAR = 12.0  # chosen
"""Contrast [grey levels] from which on the path is seen whatever share of its cells is matched:
cells without a match are then out of the flow's range, as those of near floor under a low camera,
or late; what they do not observe stays unknown."""
WIDTH = 160  # chosen
"""Width of an image [px] for which the windows are given; they grow with that of the camera."""
WINDOW = 13  # chosen
"""Side of the windows [px] in which the contrast is measured."""
_STRIDE = 4  # chosen
"""Every so many pixels [px] a window counts."""
_SUDDEN = 0.5  # chosen
"""Ratio of the newest percept's share of cells to the mean below which the path has changed: pairs
of frames from before and after something appeared there do not match."""
_SETTLE = 4  # chosen
"""Percepts after two such ones for which the path still counts as changed: the map needs hits."""
_APPEARED, _STEADY = 0.6, 0.87  # measured
"""Ratio of shares of two percepts in a row to the two before, below which something has appeared if
the mean was steady: at least the second value. Turning, or on coarse texture, it falls slowly."""
SHARE = 0.15  # chosen
"""Weight of the newest percept in the mean over the percepts so far: single ones vary."""


class PathSight:
    """Judges how well the camera shows the path ahead, from percepts and images.

    ``texture`` is the mean share of the path's cells that percepts have matched. ``contrast`` [grey
    levels] is the median standard deviation of the path's image in small windows, ``covariance``
    [grey levels^2] the median covariance of horizontal neighbours in them: texture that the lens
    resolves is alike from one pixel to the next, noise is not.
    The path is the floor that the robot would drive over. A cell of the image that shows it, or
    what stands on it, has a confidence above 0 only with texture above the noise.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._points: Array | None = None
        self._path: npt.NDArray[np.bool_] = np.zeros((0, 0), np.bool_)
        camera = robot.camera
        scale = max(1, round(camera.width / WIDTH))
        stride = _STRIDE * scale
        x, y = np.arange(0, camera.width, stride), np.arange(0, camera.height, stride)
        pixels = np.stack(np.meshgrid(x, y), axis=-1)
        middle = 0.5 * np.array([camera.width - 1, camera.height - 1])
        self._centres = np.ascontiguousarray(pixels[self._path_of(pixels - middle)])
        self._half = WINDOW * scale // 2
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run: until the first percept the path counts as well seen."""
        self.texture, self.contrast, self.covariance = 1.0, math.inf, math.inf
        self._shares, self._means = [1.0] * 4, [-1.0] * 2
        self._unsettled = 0

    @property
    def weak(self) -> bool:
        """Whether the path is seen poorly: then only rays to floor or obstacles show free space."""
        return self.contrast < _FAINT or (self.texture < _WEAK and not self._clear)

    @property
    def changed(self) -> bool:
        """Whether the newest percept, or two in a row before it, matched far less of the path."""
        return self._unsettled > 0

    @property
    def appeared(self) -> bool:
        """Whether two percepts match far less of the path than those before, which saw it well."""
        steady = not self.weak and self._means[0] >= _STEADY
        return steady and max(self._shares[2:]) < _APPEARED * min(self._shares[:2])

    @property
    def none(self) -> bool:
        """Whether next to nothing of the path is seen: no texture, or only noise."""
        unmatched = self.texture < SEEN and not self._clear
        return unmatched or (self.contrast < _FAINT and self.covariance < _BARE)

    @property
    def _clear(self) -> bool:
        return CLEAR <= self.contrast < math.inf

    @property
    def judgement(self) -> Sight:
        """How well the path is seen: ``NOTHING`` of it, ``LITTLE`` or ``ENOUGH``."""
        if self.none:
            return Sight.NOTHING
        return Sight.LITTLE if self.weak else Sight.ENOUGH

    def observe(self, percept: Percept) -> None:
        """Update the texture by the newest percept; nothing changes if the camera sees no floor."""
        if percept.points is not self._points:
            self._points, self._path = percept.points, self._path_of(percept.points)
        confidence = percept.confidence[self._path]
        if not confidence.size:
            return  # a camera that sees no floor gives no judgement
        share = float(np.count_nonzero(confidence >= CONFIDENCE) / confidence.size)
        self._shares, self._means = [*self._shares[1:], share], [self._means[1], self.texture]
        first = self._means[0] < 0.0
        self.texture = share if first else self.texture + SHARE * (share - self.texture)
        sudden, again = share < _SUDDEN * self.texture, self._unsettled > 0
        self._unsettled = 1 + again * _SETTLE if sudden else max(self._unsettled - 1, 0)

    def observe_image(self, image: Image) -> None:
        """Update contrast and covariance by the newest valid image (height, width)."""
        if not self._centres.size:
            return  # a camera that sees no floor
        variance, covariance = _median_spread(image, self._centres, self._half)
        contrast = math.sqrt(variance)
        if math.isinf(self.contrast):
            self.contrast, self.covariance = contrast, covariance
        self.contrast += SHARE * (contrast - self.contrast)
        self.covariance += SHARE * (covariance - self.covariance)

    def _path_of(self, points: Array) -> npt.NDArray[np.bool_]:
        """Return which cells (rows, cols) have rays that meet the floor of the path."""
        camera = self._robot.camera
        fall = camera.fall_per_depth(points)
        depth = camera.mount_height / np.maximum(fall, 1e-6)
        image = np.concatenate([points / camera.focal, np.ones((*points.shape[:2], 1))], axis=-1)
        rays = product(image, camera.base_from_camera.T)
        ahead, left, _ = np.moveaxis(depth[..., None] * rays, -1, 0)
        near = (ahead > 0.0) & (ahead <= REACH) & (fall > 0.0)
        return np.asarray(near & (np.abs(left) <= self._robot.radius + _BESIDE))


@numba.njit(cache=True)
def _median_spread(
    image: Image, centres: npt.NDArray[np.int64], half: int
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Return the medians, over windows, of grey values' variance and of neighbours' covariance.

    Neighbours are horizontal. The windows reach ``half`` pixels to each side of ``centres`` (n, 2)
    [px: x, y], and end at the image's border.
    """
    height, width = image.shape
    variances, covariances = np.empty(centres.shape[0]), np.empty(centres.shape[0])
    for k in range(centres.shape[0]):
        left, right = max(centres[k, 0] - half, 0), min(centres[k, 0] + half + 1, width)
        top, bottom = max(centres[k, 1] - half, 0), min(centres[k, 1] + half + 1, height)
        total, squares, products, first, last = 0, 0, 0, 0, 0
        for y in range(top, bottom):
            before = 0
            for x in range(left, right):
                grey = int(image[y, x])
                total += grey
                squares += grey * grey
                products += grey * before
                before = grey
            first += int(image[y, left])
            last += before
        pixels = (right - left) * (bottom - top)
        pairs = pixels - (bottom - top)
        variances[k] = (pixels * squares - total * total) / (pixels * pixels)
        covariances[k] = (pairs * products - (total - first) * (total - last)) / (pairs * pairs)
    return float(np.median(variances)), float(np.median(covariances))
