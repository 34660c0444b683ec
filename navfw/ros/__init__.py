"""Drive robots of ROS 2 as a node, or be one; run the stack on bags of ROS."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
