"""Affine registration of windows (Lucas and Kanade 1981; Baker and Matthews 2004)."""

from __future__ import annotations

from navfw.flow.registration.roughness import roughness
from navfw.flow.registration.windows import Registration, grid_windows, register_windows

__all__ = ["Registration", "grid_windows", "register_windows", "roughness"]
