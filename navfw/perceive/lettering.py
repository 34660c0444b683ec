"""Text in images: antialiased outlines of a TrueType font, drawn with OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from navfw.config.extras import extra_imports
from navfw.signals import Image

Colour = tuple[int, int, int]
"""Blue, green, red, each in 0..255."""
Outlines = tuple[npt.NDArray[np.float64], ...]
_SHIFT = 4  # bits of a pixel's fraction in OpenCV's drawing


@lru_cache(maxsize=2048)
def _outlines(text: str, size: float, bold: bool) -> Outlines:
    """Outlines [px] with the base line at y = 0 (y down)."""
    with extra_imports("report"):
        from matplotlib.font_manager import FontProperties
        from matplotlib.textpath import TextPath

    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    path = TextPath((0.0, 0.0), text, size=size, prop=font)
    polygons = [np.asarray(polygon, dtype=np.float64) for polygon in path.to_polygons()]
    return tuple(polygon * (1.0, -1.0) for polygon in polygons if len(polygon) > 2)


def _end(text: str, size: float, bold: bool) -> float:
    """Right end [px] of the outlines."""
    return max(float(outline[:, 0].max()) for outline in _outlines(text, size, bold))


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Width [px] of ``text`` in letters of ``size`` [px]."""
    # measured with a mark at the end, since trailing blanks have no outline
    return _end(f"{_plain(text)}|", size, bold) - _end("|", size, bold)


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
    outlines = _outlines(_plain(text), size, bold)
    if not outlines:
        return
    points = [
        np.rint((outline + np.array(at)) * (1 << _SHIFT)).astype(np.int32) for outline in outlines
    ]
    if halo is not None:
        width = max(2, round(0.22 * size))
        cv2.polylines(image, points, True, halo, width, cv2.LINE_AA, _SHIFT)
    cv2.fillPoly(image, points, colour, cv2.LINE_AA, _SHIFT)


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


def _plain(text: str) -> str:
    """``text`` with escaped dollar signs: TextPath would parse them as mathematics."""
    return text.replace("$", r"\$")
