"""Pages of HTML that need no network: templates, scripts and pictures become one text."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from navfw.config.input_file import read_input
from navfw.errors import ConfigError

__all__ = ["picture_source", "render_page"]

_HERE = Path(__file__).parent
_MAX_PICTURE = 5_000_000
"""Largest size of a picture file [byte]."""
_PNG = b"\x89PNG\r\n\x1a\n"


def picture_source(path: Path) -> str:
    """The PNG file at ``path`` as a data URL.

    Raises:
        ConfigError: it cannot be read, is too large, or is no PNG.

    """
    content = read_input(path, _MAX_PICTURE)
    if not content.startswith(_PNG):
        raise ConfigError("is not a PNG file", file=path)
    return f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}"


def render_page(template: str, **content: Any) -> str:
    """The page of ``template`` with ``content``; figures bring Bokeh's script with them."""
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    library = ""
    if content.get("figures"):
        from bokeh.resources import Resources

        library = Resources(mode="inline", components=["bokeh"], log_level="warn").render_js()
    return environment.get_template(template).render(**content, library=library)
