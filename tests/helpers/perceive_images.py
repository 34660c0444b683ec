"""Images of an approaching textured wall: a zoom with exactly known time to contact."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from navfw_benchmarks.bench.real_labels import FrameLabel

from navfw.numerics import Image

HEIGHT, WIDTH = 240, 320


def texture(seed: int = 0, size: int = 1200) -> Image:
    """Smooth noise of several octaves, without an edge."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size, size), np.float32)
    for sigma in (3.0, 7.0, 16.0):
        noise = cv2.GaussianBlur(
            rng.standard_normal((size, size)).astype(np.float32), (0, 0), sigma
        )
        total += np.asarray(noise / float(noise.std()), np.float32)
    total = 128.0 + 35.0 * total / float(total.std())
    return np.clip(total, 0, 255).astype(np.uint8)


def wall_at(distance: float, picture: Image, turned: float = 0.0, margin: int = 0) -> Image:
    """The wall at ``distance`` (1: one pixel per texel), the camera rolled by ``turned`` [deg].

    The image is larger by ``margin`` [px] on each side.
    """
    middle = 0.5 * np.array([picture.shape[1], picture.shape[0]])
    rotation = cv2.getRotationMatrix2D((middle[0], middle[1]), turned, 1.0 / distance)
    matrix = np.asarray(rotation, dtype=np.float64)
    width, height = WIDTH + 2 * margin, HEIGHT + 2 * margin
    matrix[:, 2] += 0.5 * np.array([width, height]) - middle
    return np.asarray(cv2.warpAffine(picture, matrix, (width, height)), dtype=np.uint8)


def save(folder: Path, images: list[Image]) -> Path:
    """``image_1.png``, ``image_2.png``, ... in ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, image in enumerate(images, start=1):
        assert cv2.imwrite(str(folder / f"image_{number}.png"), image)
    return folder


def total(data: object) -> float:
    """The sum of all numbers in data as of JSON, which each of them changes."""
    if isinstance(data, dict | list):
        return sum(map(total, data.values() if isinstance(data, dict) else data))
    return float(data) if isinstance(data, int | float) and not isinstance(data, bool) else 0.0


def assert_ahead(view: Mapping[str, Any], width: int, height: int) -> None:
    """The heading is straight ahead within three of its standard deviations, here below 12 deg.

    The image of one plane hardly tells a rotation from a sideways motion; the focus of expansion
    belongs to the heading.
    """
    heading, focus = view["heading"], view["focus_of_expansion"]
    assert heading["motion"] == "forward"
    assert heading["sigma_deg"] < 12.0
    off = float(np.hypot(heading["bearing_deg"], heading["elevation_deg"]))
    assert off < min(3.0 * heading["sigma_deg"], 6.0), heading
    assert abs(focus["x"] - 0.5 * width) + abs(focus["y"] - 0.5 * height) < 0.15 * (width + height)


EVERYWHERE = "upper_left upper_right lower_left lower_right"


def label(
    nearest: str = "upper_left",
    also: str = "",
    floor: str = "yes",
    front: str = "corridor",
    front_also: str = "",
    file: str = "image_3.png",
    folder: str = "approach",
) -> FrameLabel:
    """A label of the tuning split."""
    return FrameLabel(
        part=f"{folder}, a",
        split="tuning",
        folder=folder,
        file=file,
        single=False,
        nearest=frozenset(nearest.split()),
        nearest_also=frozenset(also.split()),
        floor_in_front=floor,
        front=front,
        front_also=frozenset(front_also.split()),
    )


def save_approach(data: Path, folder: str = "approach") -> list[FrameLabel]:
    """Write an approach to a wall to a ``folder`` of ``data``; labels for two of its frames."""
    picture = texture()
    save(data / folder, [wall_at(2.05 - 0.05 * k, picture) for k in range(1, 6)])
    return [
        label(EVERYWHERE, floor="no", front="wall", file=f"image_{k}.png", folder=folder)
        for k in (3, 5)
    ]
