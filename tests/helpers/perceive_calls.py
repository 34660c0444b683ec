"""Calls of the command perceive in this process, and the images of a wall that comes nearer."""

from typing import Any

from cli_calls import answer
from perceive_images import texture, wall_at

PICTURE = texture()
DISTANCES = (2.0, 1.95, 1.90, 1.85, 1.80)
APPROACH = [wall_at(d, PICTURE) for d in DISTANCES]
"""The wall at each of these distances: 0.05 nearer in each image."""


def perceive(*words: object) -> list[dict[str, Any]]:
    """What ``navfw perceive`` with ``words`` says of each pair of images."""
    result = answer("perceive", *words)
    assert isinstance(result, list)
    return result
