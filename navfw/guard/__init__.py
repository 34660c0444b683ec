"""The plugin boundary: whatever a plugin does costs its own call, and is told.

- ``plugin_guard``: calls a plugin within a time limit (``navfw.process.watchdog``), contains
  what it raises, checks its answer;
- ``answers``: the checks, one for each kind of answer;
- ``guarded_stages``: the stages of the stack with a fallback for a call that failed.
"""

from __future__ import annotations

from navfw.guard.plugin_guard import (
    FailingStage,
    PluginCallError,
    PluginFault,
    PluginGuard,
    label_of,
)
from navfw.process.watchdog import PluginTimeout

__all__ = [
    "FailingStage",
    "PluginCallError",
    "PluginFault",
    "PluginGuard",
    "PluginTimeout",
    "label_of",
]
