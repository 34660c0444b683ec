"""The labels of seen points, as the rooms after OFFIS know them."""

from __future__ import annotations

from navfw.signals import Label

__all__ = ["Label"]
