"""The place posterior of a moving pose is computed again only after some distance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.errors import InputError
from navfw.localization import PlacePosterior, known_start, likeliest_places
from navfw.signals import Pose, position_sigma
from navfw.topomap import Place, TopoMap

MAP = TopoMap("two", [Place("west", 0.0, 0.0, "room"), Place("east", 4.0, 0.0, "room")], [])
SMALL = np.diag([0.01, 0.01, 0.01])


@pytest.mark.parametrize("heading", [0.0, math.pi / 4.0, math.pi / 2.0])
def test_probabilities_are_computed_again_after_a_distance_in_any_direction(heading: float) -> None:
    posterior = PlacePosterior(MAP, refresh=0.1)
    first = posterior.at(Pose(1.0, 0.0, 0.0), SMALL)
    assert first == likeliest_places(MAP, Pose(1.0, 0.0, 0.0), SMALL)
    c, s = math.cos(heading), math.sin(heading)
    assert posterior.at(Pose(1.0 + 0.09 * c, 0.09 * s, heading), SMALL) is first
    there = Pose(1.0 + 0.11 * c, 0.11 * s, heading)
    assert posterior.at(there, SMALL) is not first
    assert posterior.at(there, 4.0 * SMALL) == likeliest_places(MAP, there, SMALL)


def test_an_unknown_start_is_refused_with_a_remedy() -> None:
    here = Pose(1.0, 2.0, 3.0)
    assert known_start(here, "mine", "another") is here
    with pytest.raises(InputError, match=r"'mine' cannot find an unknown start.*the stack another"):
        known_start(None, "mine", "another")


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0), st.floats(-math.pi, math.pi))
def test_the_position_sigma_is_the_largest_half_axis(
    long: float, short: float, turn: float
) -> None:
    c, s = math.cos(turn), math.sin(turn)
    axes = np.array([[c, -s], [s, c]])
    covariance = np.diag([0.0, 0.0, 5.0])
    covariance[:2, :2] = axes @ np.diag([long**2, short**2]) @ axes.T
    assert position_sigma(covariance) == pytest.approx(max(long, short), abs=1e-6)
    largest = max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0)
    assert position_sigma(covariance) ** 2 == pytest.approx(largest, abs=1e-9)
