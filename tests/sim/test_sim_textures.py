"""Textures: seeded, periodic, band-limited, with the specified contrast."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import pytest

from navfw.sim import TILE, TextureSpec, luminance_pattern, synthesize

Style = Literal[
    "plaster",
    "carpet",
    "wood",
    "stone",
    "panels",
    "concrete",
    "brick",
    "parquet",
    "rug",
    "roughcast",
]
STYLES = get_args(Style)
assert get_args(TextureSpec.model_fields["style"].annotation) == STYLES


@pytest.mark.parametrize("style", STYLES)
def test_same_seed_same_texture(style: Style) -> None:
    spec = TextureSpec(style=style, seed=5)
    first = synthesize(spec).copy()
    synthesize.cache_clear()
    assert np.array_equal(first, synthesize(spec))
    other = synthesize(TextureSpec(style=style, seed=6))
    assert np.abs(first.astype(int) - other).mean() > 10


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("finest", [0.03, 0.06])
def test_no_detail_finer_than_specified(style: Style, finest: float) -> None:
    pattern = luminance_pattern(TextureSpec(style=style, finest=finest))
    power = np.abs(np.fft.fft2(pattern - pattern.mean())) ** 2
    cycles = np.fft.fftfreq(len(pattern), d=TILE / len(pattern))
    frequency = np.hypot(cycles[:, None], cycles[None, :])
    # at f = 80 px a detail of 0.03 m is two pixels wide at 1.2 m (METHOD sec 0)
    assert power[frequency > 0.5 / finest].sum() < 0.01 * power.sum()
    assert power[frequency > 1.0 / finest].sum() < 0.001 * power.sum()


@pytest.mark.parametrize("style", STYLES)
def test_brightness_and_contrast(style: Style) -> None:
    pattern = luminance_pattern(TextureSpec(style=style, brightness=130, contrast=40))
    assert pattern.mean() == pytest.approx(130, abs=0.1)
    assert pattern.std() == pytest.approx(40, abs=0.1)
    assert pattern.min() > 0
    assert pattern.max() < 255


@pytest.mark.parametrize("style", STYLES)
def test_texture_is_periodic(style: Style) -> None:
    pattern = luminance_pattern(TextureSpec(style=style))
    # no step between last and first is larger than the steps inside (courses of bricks have edges)
    across = np.abs(np.diff(pattern, axis=1)).mean(axis=0).max()
    assert np.abs(pattern[:, 0] - pattern[:, -1]).mean() < 1.3 * across
    down = np.abs(np.diff(pattern, axis=0)).mean(axis=1).max()
    assert np.abs(pattern[0] - pattern[-1]).mean() < 1.3 * down


def test_tint_keeps_the_luminance() -> None:
    grey = synthesize(TextureSpec(contrast=30))
    warm = synthesize(TextureSpec(contrast=30, colour=(1.0, 0.9, 0.7)))
    luma = warm @ np.array([0.299, 0.587, 0.114])
    assert np.abs(luma - grey[:, :, 0]).max() < 2.0
    assert warm[:, :, 0].mean() > warm[:, :, 2].mean() + 20
