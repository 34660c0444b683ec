"""Missions: files, the runner, outcomes and metrics; the one room between stack and simulator."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
