"""The robots that people have: bags of ROS, replayed by the stack."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
