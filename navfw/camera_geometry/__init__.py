"""Geometry of a turning camera: rotations, image points turned by them, flow without them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
