"""MOFIS: primitive behaviours and fuzzy command fusion (paper sec 2)."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
