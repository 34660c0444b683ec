"""The page of ``navfw reproduce``: one HTML file with its pictures in it."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from navfw.offis.pyramid import position
from navfw.reproduce.paper_tables import FAST, PERIOD
from navfw.signals import Image

TEMPLATE = "reproduction.html"
QUALITY = 82
"""Quality of the pictures, of 100: flow arrows stay sharp, and the page stays below 8 MB."""


def write_page(result: Mapping[str, Any], pictures: Mapping[str, Image]) -> str:
    """The page of a ``result`` as HTML.

    ``pictures`` (height, width, 3) have the names ``map``, ``waypoint-N``, ``scene-N``, and
    ``real-K`` for the K-th frame of the recordings if it may be shown.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(percent=_percent, positions=_positions)
    return environment.get_template(TEMPLATE).render(
        **result,
        pictures={name: _embedded(picture) for name, picture in pictures.items()},
        fast=FAST,
        period=PERIOD,
        flows=("ideal", "block matching"),
        rotations=("removed", "left in"),
        modes=("normalised", "raw means"),
    )


def _embedded(picture: Image) -> dict[str, Any]:
    """A picture as data within the page, with its size."""
    code = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1].tobytes()
    data = base64.b64encode(code).decode("ascii")
    height, width = picture.shape[:2]
    return {"source": f"data:image/webp;base64,{data}", "width": width, "height": height}


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.0f} %"


def _positions(names: list[str]) -> str:
    """Quadrants in words: ``["P2", "P3"]`` as "upper left and lower left"."""
    return " and ".join(position(name) for name in names)
