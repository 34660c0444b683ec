"""Recording: the folder of a run, the file of its sensor readings, their export and replay."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
