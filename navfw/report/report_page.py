"""Pages of HTML that need no network: templates, scripts and pictures become one text."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image as PillowImage

from navfw.config.extras import extra_imports
from navfw.numerics import Image
from navfw.process.printable_text import printable_data

with extra_imports("report"):
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

_HERE = Path(__file__).parent


def reduced_source(image: Image, width: int, **options: Any) -> str:
    """``image`` as a data URL in WebP, reduced to ``width`` [px] if it is wider.

    It is gray, BGR, or BGR with opacity; ``options`` are Pillow's: quality up to 100, or lossless.
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
    """The page of ``template`` with ``content``."""
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_function"] = _dumped
    return environment.get_template(template).render(**content)


def _dumped(data: Any, **options: Any) -> str:
    return json.dumps(printable_data(data), **options)
