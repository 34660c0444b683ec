"""Assertions on the run of a mission; their messages say what the run did instead.

::

    @pytest.mark.mission(world="office", mission="lobby-to-lab")
    def test_the_way_to_the_lab(mission):
        assert_reached(mission)
        assert_clearance(mission, 0.05)
        assert_visited(mission, "corridor-west", "lab")
        assert_behavior_led(mission, "traverse_door", 1.0)
"""

from __future__ import annotations

import numpy as np

from navfw.errors import UnknownNameError
from navfw.testing.mission_run import MissionRun


def assert_reached(mission: MissionRun) -> None:
    """The robot truly reached all goals."""
    __tracebackhide__ = True
    if not mission.outcome.succeeded:
        raise AssertionError(f"expected the goal to be reached; {mission.verdict}")


def assert_no_collision(mission: MissionRun) -> None:
    """The robot touched nothing but the floor, and fell into no drop."""
    __tracebackhide__ = True
    contacts = mission.log.contacts
    if contacts:
        first = contacts[0]
        where = f"{first.body} at ({first.x:.2f}, {first.y:.2f}) after {first.time:.1f} s"
        raise AssertionError(f"expected no collision; the robot touched {where}")


def assert_clearance(mission: MissionRun, at_least: float) -> None:
    """The robot's body stayed ``at_least`` [m] away from everything."""
    __tracebackhide__ = True
    smallest = mission.metrics.min_clearance_m
    if not smallest >= at_least:
        what = f"expected a clearance of at least {at_least:g} m"
        raise AssertionError(f"{what}; the smallest was {smallest:.3f} m")


def assert_visited(
    mission: MissionRun, *places: str | tuple[float, float], within: float = 0.5
) -> None:
    """The robot truly passed within ``within`` [m] of each of ``places``, in this order.

    A place is one of the map by name, or a point x, y [m].

    Raises:
        UnknownNameError: the mission's map has no such place.

    """
    __tracebackhide__ = True
    map_places = mission.places
    start = 0
    for place in places:
        if isinstance(place, str) and place not in map_places:
            raise UnknownNameError("place", place, map_places)
        x, y = map_places[place] if isinstance(place, str) else place
        name = place if isinstance(place, str) else f"({x:g}, {y:g})"
        away = np.hypot(mission.path[start:, 0] - x, mission.path[start:, 1] - y)
        near = np.flatnonzero(away <= within)
        if not near.size:
            after = f" after {mission.log.time[start]:.1f} s" if start else ""
            closest = f"{away.min():.2f} m" if away.size else "unknown"
            what = f"expected the robot within {within:g} m of {name}{after}"
            raise AssertionError(f"{what}; its smallest distance was {closest}")
        start += int(near[0])


def assert_behavior_led(mission: MissionRun, behavior: str, at_least: float = 0.1) -> None:
    """The behaviour led for ``at_least`` [s] of simulated time in all.

    Raises:
        UnknownNameError: the stack has no such behaviour.

    """
    __tracebackhide__ = True
    if behavior not in mission.behaviors:
        raise UnknownNameError("behavior", behavior, mission.behaviors)
    log = mission.log
    tick = float(np.median(np.diff(log.time))) if log.ticks > 1 else 0.0
    led = {name: tick * int((log.leader == at).sum()) for at, name in enumerate(log.leaders)}
    if led.get(behavior, 0.0) < at_least:
        others = sorted(((time, name) for name, time in led.items() if name), reverse=True)
        shown = ", ".join(f"{name} {time:.1f} s" for time, name in others)
        what = f"expected {behavior} to lead for at least {at_least:g} s"
        raise AssertionError(f"{what}, got {led.get(behavior, 0.0):.1f} s; led: {shown or 'none'}")
