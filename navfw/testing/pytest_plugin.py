"""Missions as tests: the ``mission`` marker and fixture (pytest loads this by entry point)."""

from __future__ import annotations
