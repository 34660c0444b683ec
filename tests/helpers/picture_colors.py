"""How much of a picture has nearly a colour."""

from typing import Any

import numpy as np
import numpy.typing as npt

from navfw.recording import palette


def share_of(picture: npt.NDArray[Any], color: str, tolerance: float = 12.0) -> float:
    """The share of pixels of ``picture``, (height, width, 3) in RGB, in nearly that colour."""
    away = np.abs(picture.astype(float) - np.array(palette.rgb(color))).max(axis=2)
    return float((away < tolerance).mean())
