"""Feature Recognition Processor (paper sec 2): landmark detections from single images.

``aruco`` detects markers, ``posters`` pictures, ``combined_landmarks`` both, or nothing.
``square_localization`` computes bearing and range from the corners.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
