"""The paper's experiments repeated (sec 4.3 and 6): Tables 2 and 3, region metrics, timings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
