"""Localisation by landmarks (METHOD 4.4): a metric filter, a discrete one, and both together."""

from __future__ import annotations
