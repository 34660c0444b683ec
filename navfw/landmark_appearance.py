"""What landmarks look like: the plates that worlds show and that recognisers look for.

A landmark is a flat upright square. ``aruco`` markers stand on a white plate a third larger than
themselves, since a marker is only found by its contrast to a bright rim; the ``size`` of a landmark
is the side of the black square. A ``poster`` is a picture without a rim, and ``size`` is its side.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from navfw.signals import Array, Image

__all__ = ["ARUCO_IDS", "identity_of", "marker_dictionary", "plate_image", "plate_side"]

ARUCO_IDS = 1000
"""Ids of the largest dictionary; the smaller ones of 4 x 4 modules are its beginning."""
_DICTIONARIES = {
    50: cv2.aruco.DICT_4X4_50,
    100: cv2.aruco.DICT_4X4_100,
    250: cv2.aruco.DICT_4X4_250,
    1000: cv2.aruco.DICT_4X4_1000,
}
_MODULES = 6
_MODULE = 32
"""Texels along the edge of a marker's module."""
_POSTER = 256
_SHAPES = 70


def identity_of(kind: str, number: int) -> str:
    """What detections call a landmark: kind and id, as in ``aruco-7``."""
    return f"{kind}-{number}"


def marker_dictionary(ids: int) -> cv2.aruco.Dictionary:
    """The smallest dictionary of 4 x 4 modules with at least that many ids; ValueError if none."""
    for size, which in _DICTIONARIES.items():
        if ids <= size:
            return cv2.aruco.getPredefinedDictionary(which)
    raise ValueError(f"no dictionary has {ids} ids; the largest has {ARUCO_IDS}")


def plate_side(kind: str, size: float) -> float:
    """Side [m] of the plate on which a landmark of that size is shown."""
    return size * (_MODULES + 2) / _MODULES if kind == "aruco" else size


def plate_image(kind: str, number: int) -> Image:
    """The plate squarely seen (N, N), luminance: marker with its white rim, or poster."""
    return _aruco_plate(number) if kind == "aruco" else poster_image(number)


def _aruco_plate(number: int) -> Image:
    marker = cv2.aruco.generateImageMarker(
        marker_dictionary(ARUCO_IDS), number, _MODULES * _MODULE, borderBits=1
    )
    return np.pad(marker, _MODULE, constant_values=255).astype(np.uint8, copy=False)


@lru_cache(maxsize=256)
def poster_image(number: int) -> Image:
    """The poster of that number: overlapping discs, bars and polygons in front of soft clouds.

    Read-only (256, 256). Seeded by the number alone; shapes from a thirtieth to a third of the side
    give corners at every distance, and the clouds make no two neighbourhoods alike.
    """
    rng = np.random.default_rng([number, 20090213])
    canvas = _clouds(rng)
    for span in np.geomspace(0.34, 0.035, _SHAPES):
        grey = float(rng.uniform(15.0, 240.0))
        _shape(canvas, rng, 0.5 * span * _POSTER, grey)
    canvas += 12.0 * cv2.resize(rng.standard_normal((64, 64)), (_POSTER, _POSTER))
    image: Image = np.clip(np.rint(cv2.GaussianBlur(canvas, (0, 0), 1.0)), 0, 255).astype(np.uint8)
    image.setflags(write=False)
    return image


def _clouds(rng: np.random.Generator) -> Array:
    canvas = np.full((_POSTER, _POSTER), 128.0)
    for cells in (3, 6, 12):
        waves = rng.standard_normal((cells, cells))
        canvas += (
            60.0 / cells**0.5 * cv2.resize(waves, (_POSTER, _POSTER), interpolation=cv2.INTER_CUBIC)
        )
    return canvas


def _shape(canvas: Array, rng: np.random.Generator, radius: float, grey: float) -> None:
    """One disc, bar or polygon of that radius [px], anywhere."""
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
