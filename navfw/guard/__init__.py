"""The plugin boundary: whatever a plugin does costs its own call, and is reported.

- ``plugin_guard``: calls a plugin within a time limit (``navfw.process.watchdog``), contains
  what it raises, checks its answer;
- ``answers``: the checks, one for each kind of answer;
- ``guarded_stages``: the stages of the stack with a fallback for a call that failed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
