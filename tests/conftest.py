"""Settings for all tests."""

from __future__ import annotations

from hypothesis import settings

# examples are the same in every run, and a loaded machine is no failure
settings.register_profile("navfw", deadline=None, derandomize=True)
settings.load_profile("navfw")
