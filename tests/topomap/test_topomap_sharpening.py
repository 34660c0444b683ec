"""Surfaces out of the bands of evidence that walls leave."""

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navfw.signals.grown_grid import FREE_BELOW, OCCUPIED_FROM, Evidence
from navfw.topomap.sharpening import sharpened


@given(st.integers(2, 5), st.integers(0, 3))
def test_a_band_of_evidence_becomes_a_surface_in_its_middle(half: int, shift: int) -> None:
    evidence: Evidence = np.zeros((40, 60), np.int8)
    evidence[:, :30] = -40
    middle = 30 + half
    for column in range(middle - half, middle + half + 1):
        evidence[:, column] = round(100 - 60 * abs(column - middle) / half)
    sharp = np.roll(sharpened(np.roll(evidence, shift, axis=0)), -shift, axis=0)
    surface = np.flatnonzero(sharp[20] >= OCCUPIED_FROM)
    assert surface.min() >= middle - 1
    assert surface.max() <= middle + 1
    assert (sharp[20, : surface.min()] <= FREE_BELOW).all()
    assert (sharp[20, surface.max() + 1 :] == 0).all()


def test_what_is_thin_stays_but_for_its_ends() -> None:
    evidence: Evidence = np.full((30, 30), -40, np.int8)
    evidence[10, 5:20] = 60
    evidence[20, 20] = 96
    sharp = sharpened(evidence) >= OCCUPIED_FROM
    assert sharp[20, 20]
    assert sharp[10, 7:18].all()
    assert sharp.sum() <= 16


def test_the_middle_line_of_a_weak_band_is_of_the_surface_but_not_its_ragged_edge() -> None:
    evidence: Evidence = np.full((40, 60), -40, np.int8)
    evidence[20:25, 5:30] = 100
    evidence[20:25, 30:50] = 30
    evidence[17:20, 15:18] = 30  # a bulge of the band
    sharp = sharpened(evidence, continuous=True) >= OCCUPIED_FROM
    assert sharp[22, 7:46].all()
    assert not sharp[:20].any()
    assert (sharpened(evidence)[22, 30:33] < OCCUPIED_FROM).all()  # here it is a gap


def test_mirrored_evidence_has_mirrored_surfaces() -> None:
    rng = np.random.default_rng(3)
    blots = cv2.GaussianBlur(rng.normal(0.0, 1.0, (60, 80)), (0, 0), 3.0)
    evidence = np.clip(1200.0 * blots, -100.0, 100.0).round().astype(np.int8)
    sharp = sharpened(evidence)
    assert 50 < (sharp >= OCCUPIED_FROM).sum() < 0.5 * (evidence >= OCCUPIED_FROM).sum()
    for turned in (np.fliplr, np.flipud, np.transpose):
        mirrored = sharpened(np.ascontiguousarray(turned(evidence)))
        assert np.array_equal(mirrored, turned(sharp))
