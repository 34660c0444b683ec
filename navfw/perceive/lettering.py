"""Text in images: antialiased outlines of a TrueType font, drawn with OpenCV."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from navfw.signals import Image

__all__ = ["Colour", "text_width", "wrap", "write"]

Colour = tuple[int, int, int]
"""Blue, green, red, each in 0..255."""
Contours = tuple[tuple[npt.NDArray[np.float64], ...], float]
_SHIFT = 4  # bits of a pixel's fraction in OpenCV's drawing


@lru_cache(maxsize=2048)
def _contours(text: str, size: float, bold: bool) -> Contours:
    """Outlines [px] with the base line at y = 0 (y down), and the advance width [px]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    # measured with a mark at the end, since trailing blanks have no outline
    marked = TextPath((0.0, 0.0), f"{text}|", size=size, prop=font)
    mark = TextPath((0.0, 0.0), "|", size=size, prop=font)
    width = float(marked.get_extents().x1 - mark.get_extents().x1)
    path = TextPath((0.0, 0.0), text, size=size, prop=font)
    polygons = [np.asarray(polygon, dtype=np.float64) for polygon in path.to_polygons()]
    outlines = tuple(polygon * (1.0, -1.0) for polygon in polygons if len(polygon) > 2)
    return outlines, width


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Width [px] of ``text`` in letters of ``size`` [px]."""
    return _contours(_plain(text), size, bold)[1]


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
    outlines = _contours(_plain(text), size, bold)[0]
    if not outlines:
        return
    points = [
        np.rint((outline + np.array(at)) * (1 << _SHIFT)).astype(np.int32) for outline in outlines
    ]
    if halo is not None:
        width = max(2, round(0.22 * size))
        cv2.polylines(image, points, True, halo, width, cv2.LINE_AA, _SHIFT)
    cv2.fillPoly(image, points, colour, cv2.LINE_AA, _SHIFT)


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
