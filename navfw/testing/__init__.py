"""Tools for tests: missions as pytest tests, conformance checks for plugins, fakes.

- ``@pytest.mark.mission(...)`` with the ``mission`` fixture (a ``MissionRun``), and assertions on
  its run, such as ``assert_reached``;
- ``check_behavior(MyBehavior)`` and ``check_composite(MyComposite)``: conformance tests for user
  plugins;
- ``fakes``: an exact and fast simulator, and pilots for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfw.lazy_names import first_access

if TYPE_CHECKING:
    from navfw.testing.behavior_check import check_behavior, check_composite
    from navfw.testing.mission_assertions import (
        assert_behavior_led,
        assert_clearance,
        assert_no_collision,
        assert_reached,
        assert_visited,
    )
    from navfw.testing.mission_run import MissionRun

__all__ = [
    "MissionRun",
    "assert_behavior_led",
    "assert_clearance",
    "assert_no_collision",
    "assert_reached",
    "assert_visited",
    "check_behavior",
    "check_composite",
]

# pytest loads this package in every session: imports are deferred until they are used
_HOMES = {
    "MissionRun": "navfw.testing.mission_run",
    "assert_behavior_led": "navfw.testing.mission_assertions",
    "assert_clearance": "navfw.testing.mission_assertions",
    "assert_no_collision": "navfw.testing.mission_assertions",
    "assert_reached": "navfw.testing.mission_assertions",
    "assert_visited": "navfw.testing.mission_assertions",
    "check_behavior": "navfw.testing.behavior_check",
    "check_composite": "navfw.testing.behavior_check",
}


def __getattr__(name: str) -> Any:
    return first_access(__name__, name, _HOMES)
