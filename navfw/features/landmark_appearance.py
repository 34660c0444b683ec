"""Kinds of landmark and their appearance: the plates that the simulator renders.

A landmark is a flat upright square. ``aruco`` markers are on a white plate a third larger than the
marker, as detection needs the contrast to a bright rim. Other kinds are plugins.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import ClassVar, cast

import cv2
import numpy as np

from navfw.errors import InputError, PluginError
from navfw.guard import construct, contained, label_of, number
from navfw.interfaces import LandmarkKind
from navfw.numerics import Image
from navfw.robot import RobotModel

_ARUCO_IDS = 1000  # defined
"""Number of ids in the largest dictionary; the smaller ones of 4 x 4 modules are its first part."""
_DICTIONARIES = {  # defined
    50: cv2.aruco.DICT_4X4_50,
    100: cv2.aruco.DICT_4X4_100,
    250: cv2.aruco.DICT_4X4_250,
    1000: cv2.aruco.DICT_4X4_1000,
}
_MODULES = 6  # defined
"""Modules along a marker's side, with its black border."""
_MODULE = 32  # chosen
"""Texels along a module's side."""


def identity_of(kind: str, number: int) -> str:
    """Return the identity of a landmark in detections: kind and id, as in ``aruco-7``."""
    return f"{kind}-{number}"


def marker_dictionary(ids: int) -> cv2.aruco.Dictionary:
    """Return the smallest dictionary of 4 x 4 modules with ``ids`` ids or more; else ValueError."""
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
        """Return the side [m] of the plate: the black square with the white rim."""
        return size * (_MODULES + 2) / _MODULES

    def plate_image(self, number: int) -> Image:
        """Draw marker ``number`` with its white rim: (N, N) luminance."""
        marker = cv2.aruco.generateImageMarker(
            marker_dictionary(_ARUCO_IDS), number, _MODULES * _MODULE, borderBits=1
        )
        return np.pad(marker, _MODULE, constant_values=255).astype(np.uint8, copy=False)


_SHIPPED: dict[str, type[LandmarkKind]] = {ArucoMarker.name: ArucoMarker}


def landmark_kind(name: str) -> LandmarkKind:
    """Make the kind of landmark of that name: a shipped one, or a plugin.

    Raises:
        UnknownNameError: there is none.
        PluginError: the plugin is broken.

    """
    return construct(_SHIPPED.get(name) or _plugin_kind(name, Path.cwd()), RobotModel())


def plate_image(kind: str, id_: int) -> Image:
    """Draw a landmark's plate: (N, N) luminance. Raises as ``landmark_kind``."""
    plugin = landmark_kind(kind)
    with contained(label_of(plugin)):
        image = np.asarray(plugin.plate_image(id_))
    if image.ndim != 2 or image.shape[0] != image.shape[1] or image.dtype != np.uint8:
        what = f"plate_image returned {image.dtype} of shape {image.shape}, expected uint8, (N, N)"
        raise PluginError(what, key=label_of(plugin))
    return image


def plate_side(kind: str, size: float) -> float:
    """Return the side [m] of a plate for ``size`` [m] of landmark; raises as ``landmark_kind``."""
    plugin = landmark_kind(kind)
    with contained(label_of(plugin)):
        return number(plugin.plate_side(size), "plate_side's answer", 0.0)


@lru_cache(maxsize=64)
def _plugin_kind(name: str, folder: Path) -> type[LandmarkKind]:
    """Return a kind of landmark from the plugins found from ``folder``, the working folder."""
    from navfw.plugins import default_registry

    return cast(type[LandmarkKind], default_registry().get("landmark", name))


def check_landmark_kind(name: str) -> str:
    """Return ``name`` if it is a kind of landmark, else raise ValueError, for pydantic models."""
    try:
        landmark_kind(name)
    except InputError as error:
        raise ValueError(str(error)) from None
    return name
