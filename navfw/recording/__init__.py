"""Recording: the run folder, the log of a run, its picture, sensor readings and their replay."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
