from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfw.offis import Channels, Pyramid, position


def sizes(pyramid: Pyramid, prefix: str) -> set[tuple[int, int]]:
    return {
        (int(r[1] - r[0]), int(r[3] - r[2]))
        for name, r in zip(pyramid.names, pyramid.rectangles, strict=True)
        if name.startswith(prefix)
    }


def test_the_papers_grids_split_as_in_the_paper() -> None:
    even, odd = Pyramid((12, 16), 2), Pyramid((10, 15), 2)
    assert sizes(even, "P") == {(6, 8)}
    assert sizes(even, "sP") == {(3, 4)}
    assert sizes(odd, "P") == {(5, 8)}
    assert sizes(odd, "sP") == {(3, 4)}


def test_odd_sides_share_the_middle_row_and_column() -> None:
    pyramid = Pyramid((10, 15), 2)
    region = dict(zip(pyramid.names, pyramid.rectangles.tolist(), strict=True))
    assert region["P2"] == [0, 5, 0, 8]
    assert region["P1"] == [0, 5, 7, 15]
    assert region["sP22"] == [0, 3, 0, 4]
    assert region["sP24"] == [2, 5, 4, 8]


def test_names_and_positions_follow_the_quadrants() -> None:
    pyramid = Pyramid((12, 16), 3)
    region = dict(zip(pyramid.names, pyramid.rectangles.tolist(), strict=True))
    assert region["P1"] == [0, 6, 8, 16]
    assert region["P3"] == [6, 12, 0, 8]
    assert region["sP41"] == [6, 9, 12, 16]
    assert region["sP413"][2:] == [12, 14]
    assert position("P1") == "upper right"
    assert position("sP23") == "upper left"
    assert position("sP341") == "lower left"


def test_children_are_named_after_their_parent() -> None:
    pyramid = Pyramid((12, 16), 3)
    for index, name in enumerate(pyramid.names[:20]):
        first = pyramid.first_child(index)
        assert first is not None
        assert [pyramid.names[first + i][-2:] for i in range(4)] == [
            name[-1] + digit for digit in "1234"
        ]
    assert pyramid.first_child(20) is None


def test_a_grid_too_small_for_its_layers_is_refused() -> None:
    with pytest.raises(ValueError, match="3 x 16"):
        Pyramid((3, 16), 2)


@given(st.integers(0, 2**31), st.sampled_from([(12, 16), (10, 15), (5, 7)]))
@settings(max_examples=25, deadline=None)
def test_statistics_are_those_of_numpy(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(1.0, 0.3, (3, *shape))
    weights = rng.uniform(0.1, 1.0, (3, *shape)) * (rng.random((3, *shape)) < 0.8)
    known = (rng.random(shape) < 0.7).astype(float)
    pyramid = Pyramid(shape, 2)
    got = pyramid.statistics(Channels(values, weights, known))
    for i, (top, bottom, left, right) in enumerate(pyramid.rectangles):
        part = np.s_[top:bottom, left:right]
        assert got.known[i] == pytest.approx(known[part].mean())
        assert got.objects[i] == pytest.approx((weights[0][part] > 0).mean())
        for channel, (mean, variance) in enumerate(
            [(got.mean, got.variance), (got.mu_u, got.var_u), (got.mu_v, got.var_v)]
        ):
            x, w = values[channel][part], weights[channel][part]
            if w.sum() == 0.0:
                continue
            expected = np.average(x, weights=w)
            assert mean[i] == pytest.approx(expected)
            assert variance[i] == pytest.approx(np.average((x - expected) ** 2, weights=w))


def test_nearest_is_the_mean_of_the_nearest_eighth() -> None:
    values = np.full((3, 12, 16), 0.5)
    values[0, 0, :6] = [3.0, 2.0, 2.0, 2.0, 2.0, 1.0]  # six of the 48 cells of P2
    got = Pyramid((12, 16), 1).statistics(Channels(values, np.ones_like(values), np.ones((12, 16))))
    assert got.nearest[1] == pytest.approx(12.0 / 6.0)
    assert got.nearest[0] == pytest.approx(0.5)


def test_a_lone_cell_weighs_less_than_a_patch() -> None:
    values = np.zeros((3, 12, 16))
    values[0, 1, 1] = 2.0
    weights = np.zeros((3, 12, 16))
    weights[:, 1, 1] = 1.0
    got = Pyramid((12, 16), 1).statistics(Channels(values, weights, np.ones((12, 16))))
    assert 0.0 < got.nearest[1] < 1.0
