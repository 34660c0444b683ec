"""Plugins: discovered in three ways, verified on registration; broken ones are listed with errors.

- files in a ``behaviors/`` folder (the shipped one, and that of the user's project);
- entry points of installed packages (``navfw.behaviors``, ``navfw.flows``, ...), loaded lazily;
- in code: ``@plugin`` above a class, or ``registry.register(cls)``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
