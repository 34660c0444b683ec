"""Tools for tests: missions as pytest tests, conformance checks for plugins, fakes.

- ``@pytest.mark.mission(...)`` with the ``mission`` fixture (a ``MissionRun``);
- ``check_behavior(MyBehavior)`` and ``check_composite(MyComposite)``: conformance tests for user
  plugins;
- ``fakes``: an exact and fast simulator, and pilots for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from navfw.testing.behavior_check import check_behavior, check_composite
    from navfw.testing.pytest_plugin import MissionRun

__all__ = ["MissionRun", "check_behavior", "check_composite"]


def __getattr__(name: str) -> Any:
    # pytest loads this package in every session: imports are deferred until they are used
    if name == "MissionRun":
        from navfw.testing.pytest_plugin import MissionRun

        return MissionRun
    if name == "check_behavior":
        from navfw.testing.behavior_check import check_behavior

        return check_behavior
    if name == "check_composite":
        from navfw.testing.behavior_check import check_composite

        return check_composite
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
