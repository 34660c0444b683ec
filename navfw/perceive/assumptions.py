"""What is assumed about the camera because nobody said it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from navfw.perceive.image_sources import ImageSource
from navfw.perceive.lens_estimate import LensEstimate
from navfw.perceive.perceiver_options import PerceiverOptions
from navfw.perceive.working_size import WorkingSize


def assumptions(
    options: PerceiverOptions, source: ImageSource, size: WorkingSize
) -> dict[str, float | str]:
    """What the results for images of ``source`` assume; a key is missing where it was given.

    ``hfov_deg`` [deg] is the horizontal field of view, ``pitch_deg`` [deg] the camera's pitch,
    ``distortion`` that of the lens, ``fps`` [1/s] the frame rate. Of the motion nothing is assumed.
    """
    assumed: dict[str, float | str] = {}
    if options.hfov is None and source.hfov is None:
        view = options.angle_of_view(size.width, size.height, None)
        assumed["hfov_deg"] = round(math.degrees(view), 1)
    if source.hfov is None:
        assumed["distortion"] = "none"
    if options.pitch is None:
        assumed["pitch_deg"] = 0.0
    if not source.rate_known:
        assumed["fps"] = source.rate
    return assumed


def assumptions_line(assumed: Mapping[str, float | str]) -> str:
    """The assumptions in one line, with the options that replace them."""
    words = {
        "hfov_deg": "horizontal field of view {:g} degrees (--hfov, --calibration)",
        "distortion": "lens distortion {} (--calibration)",
        "pitch_deg": "pitch {:g} degrees until the floor shows it (--pitch)",
        "fps": "{:g} images a second (--fps, --times)",
    }
    return "assumed: " + ", ".join(words[key].format(value) for key, value in assumed.items())


def estimate_line(lens: LensEstimate) -> str:
    """What was estimated of the lens, in one line."""
    found = lens.as_data()
    if lens.shape is None:
        what = "nothing about the lens"
    elif lens.calibration is None:
        what = f"no distortion, curvature below {3.0 * lens.curvature_sigma:.2f}"
    else:
        what = f"distortion arctan {found['curvature']} +- {found['curvature_sigma']}"
    if found["focal_px"] is not None:
        what += (
            f", focal length {found['focal_px']} +- {found['focal_sigma_px']} px "
            f"({found['hfov_deg']} degrees across)"
        )
    return f"estimated: {what}, by {lens.pairs} pairs of images"
