"""The ``navfw`` command with short time limits for plugins, as a script."""

from __future__ import annotations

import navfw.cli
import navfw.process.watchdog
from navfw.guard import PluginGuard

if __name__ == "__main__":
    PluginGuard.__init__.__defaults__ = (6.0, 20.0)
    navfw.process.watchdog.GRACE = 1.0
    navfw.cli.main()
