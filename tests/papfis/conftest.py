"""Compiles the rule base of the edge costs before the first test, whose time is limited."""

from __future__ import annotations

import pytest
from papfis_maps import joined

from navfw.papfis import EdgeCosts
from navfw.robot import RobotModel
from navfw.topomap import Place, TopoMap


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    a, b = Place("a", 0.0, 0.0), Place("b", 1.0, 0.0)
    EdgeCosts(TopoMap("warm-up", [a, b], [joined(a, b)]), RobotModel())
