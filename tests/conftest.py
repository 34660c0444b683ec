"""Settings for all tests."""

from __future__ import annotations

import os
import signal

from command_tree import build_once
from hypothesis import settings

# examples are the same in every run, and a loaded machine is no failure
settings.register_profile("navfw", deadline=None, derandomize=True)
settings.load_profile("navfw")

build_once()

# a shell that starts tests in the background has them ignore Ctrl-C, and all that they start, too
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# the tests make projects with plugins in temporary folders
os.environ["NAVFW_TRUST"] = "1"
