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
from navfw.config.input_bounds import max_bytes
from navfw.config.input_file import read_input
from navfw.errors import ConfigError
from navfw.numerics import Image
from navfw.process.printable_text import printable_data

with extra_imports("report"):
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

_HERE = Path(__file__).parent
_PNG = b"\x89PNG\r\n\x1a\n"


def picture_source(path: Path) -> str:
    """The PNG file at ``path`` as a data URL.

    Raises:
        ConfigError: it cannot be read, is too large, or is no PNG.

    """
    content = read_input(path, max_bytes("picture of a report"))
    if not content.startswith(_PNG):
        raise ConfigError("is not a PNG file", file=path)
    return f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}"


def reduced_source(image: Image, width: int, quality: int) -> str:
    """``image``, gray or BGR, as a data URL in WebP, reduced to ``width`` [px] if it is wider.

    ``quality`` is that of WebP, up to 100.
    """
    high, wide = image.shape[:2]
    if wide > width:
        size = (width, max(1, round(width * high / wide)))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    code = io.BytesIO()
    shown = PillowImage.fromarray(image if image.ndim == 2 else image[..., ::-1])
    shown.save(code, "WEBP", quality=quality, method=1)  # OpenCV's has three times the time
    return f"data:image/webp;base64,{base64.b64encode(code.getvalue()).decode('ascii')}"


def render_page(template: str, **content: Any) -> str:
    """The page of ``template`` with ``content``; figures bring Bokeh's script with them."""
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_function"] = _dumped
    library = ""
    if content.get("figures"):
        from bokeh.resources import Resources

        library = Resources(mode="inline", components=["bokeh"], log_level="warn").render_js()
    return environment.get_template(template).render(**content, library=library)


def _dumped(data: Any, **options: Any) -> str:
    return json.dumps(printable_data(data), **options)
