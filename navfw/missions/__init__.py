"""Missions: their files, the run loop, outcomes and metrics; it joins stack and simulator."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
