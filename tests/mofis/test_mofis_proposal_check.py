"""The check of what a behaviour proposes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfw.mofis.proposal_check import are_degrees


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, -1e-12, 1.0 + 1e-8])
def test_one_wrong_value_makes_a_layer_invalid(wrong: float) -> None:
    layer = np.random.default_rng(1).random((11, 21))
    layer[0, 0], layer[3, 4] = 1.0 + 1e-10, 0.0
    assert are_degrees(layer)
    for spot in ((0, 0), (5, 7), (10, 20)):
        changed = layer.copy()
        changed[spot] = wrong
        assert not are_degrees(changed)
