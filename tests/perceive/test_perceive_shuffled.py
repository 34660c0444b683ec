"""Shuffled sequences are told from ordered ones by the likeness of images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from perceive_images import save, texture

from navfw.errors import InputError
from navfw.perceive.image_sources import open_source
from navfw.perceive.shuffle_check import ShuffleCheck
from navfw.signals import Image

WIDE = cv2.GaussianBlur(np.hstack([texture(k)[:120] for k in range(4)]), (0, 0), 20.0)


def panned(step: int, count: int) -> list[Image]:
    """Views of a camera that pans over a picture by ``step`` [px] from image to image."""
    return [
        np.asarray(cv2.cvtColor(WIDE[:, k : k + 160], cv2.COLOR_GRAY2BGR), np.uint8)
        for k in range(0, step * count, step)
    ]


def check(images: list[Image]) -> None:
    order = ShuffleCheck()
    for k, image in enumerate(images):
        order.add(f"{k}.png", image)
    order.finish()


def shuffled(images: list[Image], seed: int = 0) -> list[Image]:
    return [images[k] for k in np.random.default_rng(seed).permutation(len(images))]


@pytest.mark.parametrize("step", [1, 5, 20, 60, 150, 300])
def test_ordered_sequences_of_all_speeds_pass(step: int) -> None:
    images = panned(step, min(70, 4500 // step))
    check(images)
    check(images[::-1])


def test_a_camera_that_comes_back_passes() -> None:
    there = panned(12, 40)
    check(there + there[::-1] + there)


@pytest.mark.parametrize("count", [20, 50, 140])
def test_shuffled_sequences_are_refused(count: int) -> None:
    with pytest.raises(InputError, match=r"\d+\.png: the images seem to be shuffled: this one is"):
        check(shuffled(panned(5, count)))


def test_long_shuffled_sequences_are_refused_early() -> None:
    order = ShuffleCheck()
    with pytest.raises(InputError, match="seem to be shuffled"):
        for k, image in enumerate(shuffled(panned(4, 240))):
            assert k < 128
            order.add(f"{k}.png", image)


def test_what_has_no_order_passes() -> None:
    check([cv2.cvtColor(texture(k, 160), cv2.COLOR_GRAY2BGR) for k in range(16)])  # type: ignore[misc]
    check([np.full((120, 160, 3), 20 * (k % 3), np.uint8) for k in range(40)])
    still = panned(5, 1) * 40
    noise = np.random.default_rng(0)
    check([np.asarray(v + noise.integers(0, 3, v.shape, dtype=np.uint8), np.uint8) for v in still])
    check(shuffled(panned(5, 11)))


def test_folder_of_shuffled_images(tmp_path: Path) -> None:
    images = panned(5, 40)
    assert len(list(open_source([save(tmp_path / "right", images)], 10.0))) == 40
    with pytest.raises(InputError, match="seem to be shuffled"):
        list(open_source([save(tmp_path / "wrong", shuffled(images))], 10.0))
