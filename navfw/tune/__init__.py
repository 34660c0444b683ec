"""Tuning of a stack's parameters and of the break points of its rules, by Optuna."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
