"""Measured results as JSON files, one each, and the page that is written from them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
