"""Tools for tests: missions as pytest tests, and conformance checks for plugins.

- ``@pytest.mark.mission(...)`` with the ``mission`` fixture (a ``MissionRun``), and assertions on
  its run, such as ``assert_reached``;
- ``check_behavior(MyBehavior)`` and ``check_composite(MyComposite)``: conformance tests for user
  plugins.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
