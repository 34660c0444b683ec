from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.errors import InputError
from navfw.perceive import PerceiverOptions, WorkingSize

SIDES = st.integers(60, 4000)


@given(SIDES, SIDES, st.sampled_from([(12, 16), (10, 15), (24, 32), (6, 8)]))
def test_any_size_becomes_one_that_the_grid_divides(
    width: int, height: int, grid: tuple[int, int]
) -> None:
    if not 0.3 < width / height < 3.0:
        return
    rows, cols = grid
    size = WorkingSize.of(width, height, rows, cols)
    assert size.cut_width % cols == 0
    assert size.cut_height % rows == 0
    # nothing beyond the image is used, and most of it is
    assert size.cut_width <= size.scale * width + 1e-6
    assert size.cut_height <= size.scale * height + 1e-6
    assert size.cut_width * size.cut_height > 0.75 * size.scale**2 * width * height
    assert 0.25 <= size.cut_width * size.cut_height / (160 * 120) <= 4.0


@given(SIDES, SIDES, st.floats(0.4, 2.4))
def test_focal_length_follows_scale_and_cut(width: int, height: int, hfov: float) -> None:
    if not 0.4 < width / height < 2.5:
        return
    size = WorkingSize.of(width, height, 12, 16)
    camera = size.camera(hfov, 1.0, 0.0, 10.0)
    whole = 0.5 * width / math.tan(0.5 * hfov)
    assert camera.focal == pytest.approx(size.scale * whole, rel=1e-9)


def test_usual_sizes_are_not_cut() -> None:
    for width, height, cut in (
        (160, 120, (160, 120)),
        (640, 480, (160, 120)),
        (1920, 1080, (192, 108)),
        (256, 256, (144, 144)),
    ):
        size = WorkingSize.of(width, height, 12, 16)
        assert (size.cut_width, size.cut_height) == cut
        assert size.scale == pytest.approx(cut[0] / width)


@pytest.mark.parametrize("size", [(160, 120), (640, 480), (1080, 1920), (3024, 4032), (500, 500)])
def test_cells_are_about_square_and_nothing_is_cut(size: tuple[int, int]) -> None:
    rows, cols = PerceiverOptions().grid_for(*size)
    working = WorkingSize.of(*size, rows, cols)
    assert 0.7 < (working.cut_width / cols) / (working.cut_height / rows) < 1.45
    kept = working.cut_width * working.cut_height / working.scale**2
    assert kept == pytest.approx(size[0] * size[1], rel=1e-6)
    assert PerceiverOptions(grid=(6, 8)).grid_for(*size) == (6, 8)


def test_points_come_back_to_the_image() -> None:
    size = WorkingSize.of(640, 480, 12, 16)
    assert size.to_image(np.array([0.0, 0.0])) == pytest.approx([320.0, 240.0])
    assert size.to_image(np.array([-80.0, 60.0])) == pytest.approx([0.0, 480.0])


def test_a_mark_stays_where_it_is() -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    image[100:104, 400:404] = 255
    size = WorkingSize.of(640, 480, 12, 16)
    working = size.prepare(image)
    assert working.shape == (120, 160)
    assert divmod(int(working.argmax()), working.shape[1]) == (25, 100)


@pytest.mark.parametrize("shape", [(10, 10), (23, 500), (20_000, 40)])
def test_images_that_show_nothing(shape: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="images of"):
        WorkingSize.of(*shape, 12, 16)
