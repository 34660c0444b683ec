"""Estimate the lens of a camera from a sequence of images if it is not given.

Pairs of images spread over the sequence are tracked, and focal length and distortion are fitted to
them (``navfw.perceive.lens_fit``). Parameters that they determine well are used, others stay
assumed. The standard deviations are those of a jackknife over blocks of pairs, with a lower limit
for errors that all pairs have in common, such as an eccentric principal point or a rolling shutter.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from navfw.egomotion.flow_egomotion import PointMotion
from navfw.errors import InputError
from navfw.lenses import ARCTAN, CameraCalibration, LensShape, focal_for
from navfw.perceive.image_sources import ImageSource
from navfw.perceive.lens_fit import LensFit
from navfw.perceive.pair_motion import TrackImage, track_points
from navfw.perceive.perceiver_options import HFOV, WorkingSize

_LOOKED_AT = 120
"""Number of pairs that are tracked."""
_MAX_PAIRS = 100
"""Largest number of pairs that are used."""
MAX_PIXELS = 600_000_000
"""Number of pixels after which no more images are read: 2000 images of 640 x 480."""
MIN_POINTS = 60
"""Least number of points of a pair."""
FLOW, MIN_FLOW = 0.1, 0.01
"""Median flow of a pair that the distance between its images aims at, and the least one, as shares
of the image's width."""
_MAX_PAIR = 15
"""Largest distance between the images of a pair [images]."""


def lens_pairs(
    images: ImageSource, tick: Callable[[], None]
) -> tuple[list[PointMotion], tuple[int, int]]:
    """Track pairs with enough points and flow; also return the images' size (width, height) [px].

    Images are read up to the first that is unreadable, which the next reader reports; ``tick`` is
    called after each.
    """
    pairs: list[PointMotion] = []
    earlier: deque[TrackImage] = deque(maxlen=_MAX_PAIR)
    width, height, stride = 0, 0, 2
    with contextlib.suppress(InputError):
        for count, item in enumerate(images):
            height, width = item.image.shape[:2]
            max_count = MAX_PIXELS // (width * height)
            if count > max_count:
                break
            if item.after_gap:
                earlier.clear()
            now = TrackImage.of(item.image)
            spacing = max(min(images.total or max_count, max_count) // _LOOKED_AT, 1)
            if count % spacing == 0 and earlier:
                size = WorkingSize(width, height, 1.0, width, height)
                stride = _add_pair(pairs, earlier, now, size, stride)
            earlier.append(now)
            tick()
    return pairs[:: 1 + len(pairs) // _MAX_PAIRS], (width, height)


def _add_pair(
    pairs: list[PointMotion],
    earlier: Sequence[TrackImage],
    now: TrackImage,
    size: WorkingSize,
    stride: int,
) -> int:
    """Track points to the image ``stride`` before ``now``; return the stride of the next pair."""
    apart = min(stride, len(earlier))
    tracks = track_points(earlier[-apart], now, size)
    if len(tracks.points) < MIN_POINTS:
        return max(stride // 2, 1)
    flow = float(np.median(np.hypot(*(tracks.points - tracks.past).T))) / size.width
    if flow > MIN_FLOW:
        pairs.append(tracks)
    wanted = apart * min(max(FLOW / max(flow, 1e-3), 0.5), 2.0)
    return min(max(round(wanted), 1), _MAX_PAIR)


MIN_PAIRS = 15
"""Least number of pairs for an estimate."""
BLOCKS = 5
"""Number of blocks of the jackknife."""
_FOCAL_FLOOR, _CURVATURE_FLOOR, _BORDER_FLOOR = 0.05, 0.05, 0.01
"""Least standard deviations of the focal length, relative to it, of the curvature, and of the
distortion at the border: the errors of estimates on recordings with known lenses."""
_MIN_BEND = 0.015
"""Least bend of the rotational flow at the border that determines a focal length, relative to the
image's width: without rotation every focal length explains the images."""
_SURE_FOCAL = 0.1
"""Largest standard deviation of a focal length that is used, relative to it."""
_MIN_BORDER = 0.03
"""Least distortion that is removed: the shift of the middle of the left and right border, relative
to its distance from the centre."""
SURE = 3.0
"""Least difference of a lens from a pinhole or an equidistant fisheye [sigma]."""


@dataclass(frozen=True, slots=True)
class LensEstimate:
    """The lens estimated from a sequence; ``size`` (width, height) [px] is that of the images.

    ``shape`` is the fitted lens, None if nothing is well determined; ``focal_sigma`` is relative to
    the focal length, 0 if that was given, and ``curvature_sigma`` that of the curvature, which is 0
    if it is not significant. ``pairs`` is the number of pairs used.
    """

    size: tuple[int, int]
    pairs: int
    shape: LensShape | None = None
    focal_sigma: float = math.inf
    curvature_sigma: float = math.inf

    @property
    def hfov(self) -> float | None:
        """Horizontal field of view [deg] of the lens; None if it is unknown."""
        return None if self.shape is None else self.shape.view(0.5 * self.size[0])

    def known_hfov(self, assigned: float | None) -> float | None:
        """Return the images' field of view [deg]: ``assigned`` or estimated; None if unknown.

        It is None, too, if ``calibration`` is not None, which then contains it.
        """
        if self.calibration is not None:
            return None
        return self.hfov if assigned is None else assigned

    @property
    def calibration(self) -> CameraCalibration | None:
        """The lens as a calibration; None if it is unknown or has no distortion."""
        if self.shape is None or self.shape.curvature == 0.0:
            return None
        width, height = self.size
        focal = self.shape.focal
        x, y = 0.5 * (width - 1), 0.5 * (height - 1)
        return CameraCalibration(
            file="the lens estimated from the images",
            matrix=np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]]),
            coefficients=np.array([self.shape.curvature]),
            model=ARCTAN,
            size=self.size,
        )

    def as_data(self) -> dict[str, float | int | None]:
        """Return the estimate as JSON data; None for values given or not well determined."""
        data: dict[str, float | int | None] = dict.fromkeys(
            ("focal_px", "focal_sigma_px", "hfov_deg", "curvature", "curvature_sigma")
        )
        if self.shape is not None and self.focal_sigma > 0.0:
            data["focal_px"] = round(self.shape.focal, 2)
            data["focal_sigma_px"] = round(self.focal_sigma * self.shape.focal, 2)
            data["hfov_deg"] = round(self.shape.view(0.5 * self.size[0]), 1)
        if self.shape is not None:
            data["curvature"] = round(self.shape.curvature, 3)
            data["curvature_sigma"] = round(self.curvature_sigma, 3)
        return {"pairs": self.pairs, **data}


def estimate_line(lens: LensEstimate) -> str:
    """Format the estimate of the lens as a line of text."""
    data = lens.as_data()
    if lens.shape is None:
        what = "nothing about the lens"
    elif lens.calibration is None:
        what = f"no distortion, curvature below {3.0 * lens.curvature_sigma:.2f}"
    else:
        what = f"distortion arctan {data['curvature']} +- {data['curvature_sigma']}"
    if data["focal_px"] is not None:
        what += (
            f", focal length {data['focal_px']} +- {data['focal_sigma_px']} px "
            f"({data['hfov_deg']} degrees across)"
        )
    return f"estimated: {what}, by {lens.pairs} pairs of images"


def estimate_lens(
    images: ImageSource, hfov: float | None, tick: Callable[[], None] = lambda: None
) -> LensEstimate:
    """Estimate the lens that took ``images``; ``hfov`` [deg] is its field of view if known.

    ``tick`` is called after each image and each fit. Images are read up to the first bad one.
    Focal length and curvature are correlated: the simplest lens that the images do not contradict
    is taken, a pinhole or an equidistant fisheye, before one of any curvature.
    """
    pairs, size = lens_pairs(images, tick)
    if len(pairs) < MIN_PAIRS:
        return LensEstimate(size, len(pairs))
    view, half = None if hfov is None else math.radians(hfov), 0.5 * size[0]
    fit = LensFit(pairs, half, view)
    shape = fit.refined(fit.start())
    tick()
    shape, (focal_sigma, curvature_sigma, border_sigma) = _jackknife(fit, shape, len(pairs), half)
    tick()
    border_sigma = math.hypot(border_sigma, _BORDER_FLOOR)
    curvature_sigma = math.hypot(curvature_sigma, _CURVATURE_FLOOR)
    simple = None
    if abs(shape.border(half)) < max(_MIN_BORDER, SURE * border_sigma):
        simple = 0.0
    elif abs(shape.curvature - 1.0) < SURE * curvature_sigma:
        simple = 1.0
    if simple is not None and view is not None:
        shape = LensShape(focal_for(half, 0.5 * view, simple), simple)
    elif simple is not None:
        fit = LensFit(pairs, half, curvature=simple)
        start = LensShape(shape.focal, simple)
        shape, (focal_sigma, _, _) = _jackknife(fit, start, len(pairs), half)
    focal_sigma = 0.0 if view is not None else math.hypot(focal_sigma, _FOCAL_FLOOR)
    determined = view is not None or fit.bend(shape) > _MIN_BEND * size[0]
    if not determined or focal_sigma > _SURE_FOCAL or not HFOV[0] <= shape.view(half) <= HFOV[1]:
        return LensEstimate(size, len(pairs))
    return LensEstimate(size, len(pairs), shape, focal_sigma, curvature_sigma)


def _jackknife(
    fit: LensFit, start: LensShape, count: int, half: float
) -> tuple[LensShape, list[float]]:
    """Return the lens of ``fit`` near ``start``, and the standard deviations of its parameters.

    These are the logarithm of the focal length, the curvature, and the distortion at the border.
    The fit is repeated without each block of its ``count`` pairs.
    """
    shape = fit.refined(start)
    edges = np.linspace(0, count, BLOCKS + 1).round().astype(int).tolist()
    fits = [fit.refined(shape, slice(first, last)) for first, last in itertools.pairwise(edges)]
    values = np.array(
        [
            (math.log(fit_without.focal), fit_without.curvature, fit_without.border(half))
            for fit_without in fits
        ]
    )
    return shape, (values.std(axis=0) * math.sqrt(BLOCKS - 1)).tolist()
