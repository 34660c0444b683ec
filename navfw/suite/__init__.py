"""Suites: evaluate worlds x missions x seeds in worker processes; one table, one summary."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
