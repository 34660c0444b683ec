"""Textures from pictures: PNG and JPEG files, scaled to metres and low-pass filtered.

The rasteriser samples single texels (see ``navfw.sim.textures``), so a picture loses the detail
finer than the texture's ``finest``, as a pattern does. Beyond its size it repeats, like tiles.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from navfw.config.image_file import read_image
from navfw.errors import ConfigError
from navfw.signals import Array, Image
from navfw.sim.texture_spectra import RESOLUTION, TILE, filtered, frequencies, passed_share

if TYPE_CHECKING:
    from navfw.sim.worldspec import TextureSpec

_MAX_PICTURE_PIXELS = 4_000_000
"""Largest number of pixels: 4 mm each over 8 x 8 m, finer than the camera resolves."""
_MAX_PICTURE_BYTES = 20_000_000
"""Largest size of a picture's file [byte]."""
_MAX_ASPECT = 20.0
"""Largest ratio of a picture's sides."""
_MAX_TEXELS = 2048
"""Largest number of texels along an edge; a wider picture has texels of more than 4 mm."""


@lru_cache(maxsize=16)
def read_picture(path: str) -> Image:
    """The picture in a file, read-only (height, width, 3) uint8, RGB.

    Raises:
        ConfigError: the file cannot be read, is no PNG or JPEG image, is damaged, has more than
            ``_MAX_PICTURE_PIXELS``, or is a narrow strip.

    """
    image = read_image(path, max_bytes=_MAX_PICTURE_BYTES, max_pixels=_MAX_PICTURE_PIXELS)
    height, width = image.shape[:2]
    if max(height, width) > _MAX_ASPECT * min(height, width):
        what = f"the picture is {width} x {height} pixels; its sides may differ by a factor of"
        raise ConfigError(f"{what} {_MAX_ASPECT:g} at most: cut it", file=path)
    picture: Image = np.ascontiguousarray(image[:, :, ::-1]).astype(np.uint8)
    picture.setflags(write=False)
    return picture


def covered_area(picture: Image, size: float | None) -> tuple[float, float]:
    """Width and height [m] of a picture that is ``size`` [m] wide; none: as wide as a tile."""
    width = TILE if size is None else size
    return width, width * picture.shape[0] / picture.shape[1]


def picture_texture(spec: TextureSpec) -> Image:
    """The texels (height, width, 3) of a texture with a picture, RGB, without aliasing detail."""
    assert spec.picture is not None  # noqa: S101 - the caller has tested it
    picture = read_picture(spec.picture)
    area = covered_area(picture, spec.size)
    columns, rows = (
        min(max(math.ceil(edge * RESOLUTION / TILE), 16), _MAX_TEXELS) for edge in area
    )
    shrinks = columns < picture.shape[1]
    how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    scaled = cv2.resize(picture, (columns, rows), interpolation=how).astype(np.float64)
    smooth = np.stack([_low_passed(scaled[..., c], area, spec.finest) for c in range(3)], axis=2)
    texels: Image = np.clip(np.rint(smooth), 0, 255).astype(np.uint8)
    return texels


def _low_passed(channel: Array, area: tuple[float, float], finest: float) -> Array:
    """``channel`` (rows, columns) without half wavelengths below ``finest`` [m]; periodic."""
    keep = passed_share(np.hypot(*frequencies(channel.shape, area[::-1])), finest)
    return filtered(channel, keep)
