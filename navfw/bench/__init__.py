"""Benchmarks of single parts against ground truth or a reference; results are plain data."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
