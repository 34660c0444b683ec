"""Tunes a stack's parameters and the break points of its rules with Optuna."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
