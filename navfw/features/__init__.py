"""Feature Recognition Processor (paper sec 2): landmark detections from single images.

``recognizers`` detects markers, or nothing, and computes bearing and range from their corners;
``landmark_appearance`` draws them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
