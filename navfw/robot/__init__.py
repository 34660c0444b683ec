"""The robot: its model, robot files and URDFs, cameras; shared by stack and simulator."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
