"""Read the lens of images from a ``CameraInfo`` of ROS 1 or 2 (REP 104): K, D and P."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from navfw.errors import InputError
from navfw.lenses.calibration_file import read_calibration
from navfw.lenses.lens_models import Undistortion

_RECTIFIED = re.compile(r"(?:^|[/_])rect(?:ified)?(?:[/_]|$)")
"""Matches topics of images without distortion."""


def info_text(info: Any, images: str) -> str:
    """Convert ``info`` to the text of a calibration file.

    ``images`` is the topic of its images: rectified ones get the projection matrix and no
    distortion.
    """
    matrix, bent, flat = (
        np.asarray(getattr(info, name if hasattr(info, name) else name.upper())) for name in "kdp"
    )
    if _RECTIFIED.search(images):
        flat = flat.reshape(3, 4)[:, :3].ravel()
        matrix, bent = flat if flat.any() else matrix, np.empty(0)
    part = {name: getattr(info.roi, name) for name in ("x_offset", "y_offset", "width", "height")}
    numbers = {"image_width": info.width, "image_height": info.height, "roi": part}
    numbers |= {name: getattr(info, name) for name in ("binning_x", "binning_y")}
    model = info.distortion_model if bent.size else "plumb_bob"
    lens = {"K": matrix.tolist(), "D": bent.tolist(), "distortion_model": model}
    return json.dumps({**numbers, **lens})


def info_undistortion(
    text: str, topic: str, width: int, height: int, hfov: float | None = None
) -> Undistortion:
    """Make the object that straightens images of ``width`` x ``height`` px by an info's ``text``.

    ``topic`` is that of the info; ``hfov`` [rad] is as for ``Undistortion``.

    Raises:
        InputError: they contradict each other; the message is the reason, without the topic.

    """
    try:
        lens = read_calibration(text, topic)
        straighten = Undistortion(lens, width, height, key=None, hfov=hfov)
    except InputError as error:
        reason = re.sub(rf"^{re.escape(topic)}(:\d+)?: ", "", str(error))
        raise InputError(reason) from None
    read = json.loads(text)
    is_part = max(read["binning_x"], read["binning_y"], read["roi"]["width"]) > 1
    if is_part and lens.size is not None and lens.size != (width, height):
        sizes = f"{lens.size[0]} x {lens.size[1]} px, not {width} x {height}"
        raise InputError(f"by its binning and its region of interest images have {sizes}")
    return straighten
