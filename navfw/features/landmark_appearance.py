"""Kinds of landmark and their appearance: the plates that the simulator renders.

A landmark is a flat upright square. ``aruco`` markers are on a white plate a third larger than the
marker, as detection needs the contrast to a bright rim. Other kinds than the two here are plugins.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import ClassVar, cast

import cv2
import numpy as np

from navfw.errors import InputError
from navfw.interfaces import LandmarkKind
from navfw.numerics import Array, Image
from navfw.robot import RobotModel

_ARUCO_IDS = 1000
"""Number of ids in the largest dictionary; the smaller ones of 4 x 4 modules are its first part."""
_DICTIONARIES = {
    50: cv2.aruco.DICT_4X4_50,
    100: cv2.aruco.DICT_4X4_100,
    250: cv2.aruco.DICT_4X4_250,
    1000: cv2.aruco.DICT_4X4_1000,
}
_MODULES = 6
"""Modules along a marker's side, with its black border."""
_MODULE = 32
"""Texels along a module's side."""
_POSTER = 256
"""Texels along a poster's side."""
_SHAPES = 70
"""Number of shapes on a poster."""


def identity_of(kind: str, number: int) -> str:
    """The identity of a landmark in detections: kind and id, as in ``aruco-7``."""
    return f"{kind}-{number}"


def marker_dictionary(ids: int) -> cv2.aruco.Dictionary:
    """The smallest dictionary of 4 x 4 modules with at least that many ids; ValueError if none."""
    for size, which in _DICTIONARIES.items():
        if ids <= size:
            return cv2.aruco.getPredefinedDictionary(which)
    raise ValueError(f"no dictionary has {ids} ids; the largest has {_ARUCO_IDS}")


class ArucoMarker(LandmarkKind):
    """A marker of 4 x 4 modules on a white plate a third larger; its size is the black square's."""

    name: ClassVar[str] = "aruco"
    ids: ClassVar[int] = _ARUCO_IDS
    default_size: ClassVar[float] = 0.25

    def plate_side(self, size: float) -> float:
        """Side [m] of the plate: the black square with the white rim."""
        return size * (_MODULES + 2) / _MODULES

    def plate_image(self, number: int) -> Image:
        """The marker with its white rim (N, N), luminance."""
        marker = cv2.aruco.generateImageMarker(
            marker_dictionary(_ARUCO_IDS), number, _MODULES * _MODULE, borderBits=1
        )
        return np.pad(marker, _MODULE, constant_values=255).astype(np.uint8, copy=False)


class Poster(LandmarkKind):
    """A picture generated from its id, without a rim; its size is the picture's side."""

    name: ClassVar[str] = "poster"

    def plate_image(self, number: int) -> Image:
        """The picture (N, N), luminance."""
        return poster_image(number)


_SHIPPED: dict[str, type[LandmarkKind]] = {kind.name: kind for kind in (ArucoMarker, Poster)}


def landmark_kind(name: str) -> LandmarkKind:
    """The kind of landmark of that name: a shipped one, or a plugin.

    Raises:
        UnknownNameError: there is none.
        PluginError: the plugin is broken.

    """
    return (_SHIPPED.get(name) or _plugin_kind(name, Path.cwd()))(RobotModel())


@lru_cache(maxsize=64)
def _plugin_kind(name: str, folder: Path) -> type[LandmarkKind]:
    """A kind of landmark from the plugins found from ``folder``, the working folder."""
    from navfw.plugins import default_registry

    return cast(type[LandmarkKind], default_registry().get("landmark", name))


def check_landmark_kind(name: str) -> str:
    """``name`` if a kind of landmark has it; ValueError if none has, for pydantic models."""
    try:
        landmark_kind(name)
    except InputError as error:
        raise ValueError(str(error)) from None
    return name


@lru_cache(maxsize=256)
def poster_image(number: int) -> Image:
    """Luminance (256, 256), read-only, of a poster: discs, bars and polygons over smooth noise.

    Seeded only by ``number``. Shapes from a thirtieth to a third of the side give features at
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
