"""HTML pages that need no network: template, scripts and pictures in one text.

``PerceivePage`` is the page of perceived images: picture, sentence, floor in front and nearness.
"""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image as PillowImage

from navfw.config.extras import extra_imports
from navfw.numerics import Image
from navfw.process.printable_text import printable_data
from navfw.recording.run_folder import plain_json

with extra_imports("report"):
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

_HERE = Path(__file__).parent


def reduced_source(image: Image, width: int, **options: Any) -> str:
    """Encode ``image`` as a WebP data URL, reduced to ``width`` [px] if it is wider.

    It is gray, BGR, or BGR with opacity; ``options`` are Pillow's: quality to 100, or lossless.
    """
    high, wide = image.shape[:2]
    if wide > width:
        size = (width, max(1, round(width * high / wide)))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    code = io.BytesIO()
    shown = image if image.ndim == 2 else image[..., [2, 1, 0, 3][: image.shape[2]]]
    # OpenCV's has three times the time
    PillowImage.fromarray(shown).save(code, "WEBP", **{"method": 1, **options})
    return f"data:image/webp;base64,{base64.b64encode(code.getvalue()).decode('ascii')}"


def render_page(template: str, **content: Any) -> str:
    """Render the HTML page of the file ``template`` in this folder with ``content``."""
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_function"] = lambda data, **options: json.dumps(
        printable_data(data), **options
    )
    return environment.get_template(template).render(**content)


_WIDTH, _QUALITY = 640, 60
"""Width [px] and quality of the pictures."""
_MAX_PICTURES = 600
"""Largest number of pictures on a page; of longer sequences only every 2nd, 4th, ... is shown."""
_KEPT = "time", "statements", "notes", "front", "confidence", "ttc_s"
_QUADRANTS = ("P1", "P2", "P3", "P4")


def moment_of(picture: Image, result: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the page of perceived images shows of a result, given as plain data.

    ``picture`` (height, width, 3) BGR is its overlay.
    """
    image = reduced_source(picture, _WIDTH, quality=_QUALITY)
    return {name: result[name] for name in _KEPT} | {"contacts": _contacts(result), "image": image}


def _contacts(result: Mapping[str, Any]) -> list[float | None]:
    """Return the time to contact [s] of each quadrant, None where it is unknown."""
    return [result["distances"][name]["ttc_s"] for name in _QUADRANTS]


class PerceivePage:
    """Collects the results of an image sequence called ``title`` for one page without network."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._moments: list[dict[str, Any]] = []
        self._nearness: list[tuple[float, ...]] = []
        self._every, self._seen, self._changes, self._sentence = 1, 0, 0, ""

    def add(self, picture: Image, result: Mapping[str, Any]) -> None:
        """Add an image: its overlay (height, width, 3) BGR, and its result as plain data."""
        nearness = (math.nan if one is None else 1.0 / one for one in _contacts(result))
        self._nearness.append((result["time"], *nearness))
        self._seen += 1
        self._changes += self._sentence not in {"", result["sentence"]}
        self._sentence = result["sentence"]
        if (self._seen - 1) % self._every:
            return
        self._moments.append(moment_of(picture, result))
        if len(self._moments) > _MAX_PICTURES:
            self._every *= 2
            del self._moments[1::2]

    def render(self, notes: list[str], *, live: bool = False) -> str:
        """Return the page as HTML, with ``notes`` on the whole sequence.

        A ``live`` page shows what ``PerceiveServer`` sends it.
        """
        columns = np.round(np.array(self._nearness).reshape(-1, 5).T, 4)
        return render_page(
            "perceive_page.html",
            title=self._title,
            live=live,
            notes=notes,
            moments=self._moments,
            pairs=self._seen,
            changes=self._changes,
            nearness=plain_json(columns),
        )
