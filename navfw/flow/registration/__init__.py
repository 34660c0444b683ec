"""Affine registration of windows (Lucas and Kanade 1981; Baker and Matthews 2004)."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
