"""Data files: read safely, validated with the line of every mistake, and found by name."""

from __future__ import annotations
