"""The map that grows while the robot drives, in the frame ``map``, from its observations.

``submaps`` takes from the local map what was observed since the last key pose; ``growing_map``
joins these submaps at their poses to one global grid of evidence.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
