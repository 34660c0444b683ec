"""Navground's HL behaviour as a plugin: it avoids the obstacles of the true surroundings."""

import importlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import pytest
from behavior_samples import desired_twist
from navfw_benchmarks.plugins import navground
from navfw_benchmarks.plugins.navground import Navground

from navfw.errors import MissingExtraError, PluginError
from navfw.robot import RobotModel
from navfw.signals import Twist
from navfw.testing import contexts_of
from navfw.testing.behavior_scenes import BehaviorScene

ROBOT = RobotModel()
OPEN = contexts_of(BehaviorScene("open", Twist(0.3, 0.0), waypoint=(4.0, 0.0), ticks=3))[-1]


@pytest.fixture
def drive(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Twist]:
    """The twist among these edges, discs and walkers."""
    pytest.importorskip("navground", reason="the extra navground is not installed")

    def driven(edges: Any = (), discs: Any = (), walkers: Any = ()) -> Twist:
        behavior = Navground(ROBOT)
        behavior.set_truth(Mock())
        monkeypatch.setattr(navground, "surroundings", lambda *_: (edges, discs, walkers))
        proposal = behavior.propose(OPEN)
        assert proposal.applicability == 1.0
        return desired_twist(OPEN, proposal)

    return driven


def test_in_the_open_it_goes_straight_on(drive: Callable[..., Twist]) -> None:
    twist = drive()
    assert twist.v > 0.3
    assert abs(twist.w) < 0.05


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_passes_an_obstacle_on_the_shorter_side(
    drive: Callable[..., Twist], side: float
) -> None:
    disc = [[1.0, side * 0.15, 0.3]]
    assert drive(discs=disc).w * side < -0.2
    wall = [[[1.0, side * 2.0], [1.0, -side * 0.2]]]
    assert drive(edges=wall).w * side < -0.2


def test_it_gives_way_to_a_crossing_person(drive: Callable[..., Twist]) -> None:
    crossing = [[1.2, -0.9, 0.25, 0.0, 0.5]]
    standing = [[1.2, -0.9, 0.25, 0.0, 0.0]]
    a, b = (drive(walkers=walkers) for walkers in (crossing, standing))
    assert abs(a.w - b.w) + abs(a.v - b.v) > 0.1


def test_it_is_an_oracle_and_needs_the_true_surroundings() -> None:
    pytest.importorskip("navground", reason="the extra navground is not installed")
    assert Navground.oracle
    with pytest.raises(PluginError, match="needs the simulator's truth"):
        Navground(ROBOT).propose(OPEN)
    assert Navground(ROBOT).propose(replace(OPEN, waypoint=None)).applicability == 0.0


def test_without_the_package_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = ModuleNotFoundError("No module named 'navground'", name="navground")
    monkeypatch.setattr(importlib, "import_module", Mock(side_effect=missing))
    with pytest.raises(MissingExtraError, match=r"pip install 'navfw\[navground\]'") as caught:
        Navground(ROBOT)
    assert caught.value.extra == "navground"
