"""The process of a run and its output: atomic files, locks, interruption, watchdog, progress."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
