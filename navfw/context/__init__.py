"""The context of a decision: what behaviours know, and the commands they choose from.

Plain data that the stack hands to the plugins of MOFIS; it depends on signals, robot and local map
only, so that interfaces and MOFIS share it without a circle.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
