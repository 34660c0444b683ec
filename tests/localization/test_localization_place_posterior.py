"""Places about a pose that moves: weighed again when it has come far enough, and not before."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfw.errors import InputError
from navfw.localization.place_posterior import PlacePosterior, known_start, likeliest_places
from navfw.signals import Pose
from navfw.topomap import Place, TopoMap

MAP = TopoMap("two", [Place("west", 0.0, 0.0, "room"), Place("east", 4.0, 0.0, "room")], [])
SURE = np.diag([0.01, 0.01, 0.01])


@pytest.mark.parametrize("heading", [0.0, math.pi / 4.0, math.pi / 2.0])
def test_places_are_weighed_again_after_so_much_way_whatever_its_direction(heading: float) -> None:
    nearby = PlacePosterior(MAP, refresh=0.1)
    first = nearby.at(Pose(1.0, 0.0, 0.0), SURE)
    assert first == likeliest_places(MAP, Pose(1.0, 0.0, 0.0), SURE)
    c, s = math.cos(heading), math.sin(heading)
    assert nearby.at(Pose(1.0 + 0.09 * c, 0.09 * s, heading), SURE) is first
    there = Pose(1.0 + 0.11 * c, 0.11 * s, heading)
    assert nearby.at(there, SURE) is not first
    assert nearby.at(there, 4.0 * SURE) == likeliest_places(MAP, there, SURE)


def test_an_unknown_start_is_refused_with_what_to_do_instead() -> None:
    here = Pose(1.0, 2.0, 3.0)
    assert known_start(here, "mine", "another") is here
    with pytest.raises(InputError, match=r"'mine' cannot find an unknown start.*the stack another"):
        known_start(None, "mine", "another")
