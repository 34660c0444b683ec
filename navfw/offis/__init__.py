"""OFFIS, the optical-flow fuzzy inference system (paper sec 4 and 5).

Input is a derotated flow field. Output is a percept: metric nearness with labels (floor, obstacle,
drop, above), and the paper's fuzzy results (nearest objects, planes, slopes, elementary
situations).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
