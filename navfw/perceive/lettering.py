"""Text in images, in a TrueType font, drawn with Pillow."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from navfw.config.extras import require_extra
from navfw.numerics import Image

Colour = tuple[int, int, int]
"""Blue, green, red, each in 0..255."""
_HALO = 0.11
"""Width of the halo around letters, relative to their size."""


@cache
def _font(size: float, bold: bool) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which comes with matplotlib; matplotlib itself is not loaded."""
    require_extra("report", "matplotlib")
    spec = find_spec("matplotlib")
    (folder,) = (spec and spec.submodule_search_locations) or ("",)
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(folder, "mpl-data", "fonts", "ttf", name), size)


def text_width(text: str, size: float) -> float:
    """Width [px] of ``text`` in letters of ``size`` [px]."""
    return _font(size, bold=False).getlength(text)


def write(
    image: Image,
    text: str,
    at: tuple[float, float],
    size: float,
    colour: Colour,
    *,
    bold: bool = False,
    halo: Colour | None = None,
) -> None:
    """Write into ``image``; ``at`` (x, y) [px] is the left end of the base line.

    ``halo`` is the colour of an outline that keeps the text readable on any background.
    """
    font = _font(size, bold)
    stroke = 0.0 if halo is None else max(1.0, _HALO * size)
    left, top = max(0, int(at[0] - size)), max(0, int(at[1] - 1.5 * size))
    right = int(at[0] + font.getlength(text) + size)
    # the part with the text alone: a copy of all of the image costs more than the letters
    around = image[top : max(0, int(at[1] + size)), left : max(0, right)]
    if not around.size:
        return
    canvas = PillowImage.fromarray(np.ascontiguousarray(around))
    ImageDraw.Draw(canvas).text(
        (at[0] - left, at[1] - top),
        text,
        fill=colour,
        font=font,
        anchor="ls",
        stroke_width=stroke,
        stroke_fill=halo,
    )
    around[:] = np.asarray(canvas)


def write_key(
    image: Image,
    key: Sequence[tuple[str, Colour]],
    at: tuple[float, float],
    size: float,
    ink: Colour,
) -> None:
    """Write names in ``ink``, each after a patch of its colour, in as many lines as they need.

    ``at`` (x, y) [px] is the left end of the first base line; as much room is left on the right.
    """
    left, base = at
    x, patch = left, 0.8 * size
    for name, colour in key:
        width = 1.3 * size + text_width(name, size)
        if x > left and x + width > image.shape[1] - left:
            x, base = left, base + 1.5 * size
        corner = round(x), round(base - patch)
        cv2.rectangle(image, corner, (round(x + patch), round(base)), colour, cv2.FILLED)
        write(image, name, (x + 1.3 * size, base), size, ink)
        x += width + 1.2 * size


def wrap(text: str, size: float, width: float) -> list[str]:
    """``text`` in lines no wider than ``width`` [px]; a longer single word is not broken."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(longer, size) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines
