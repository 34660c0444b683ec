"""Run OFFIS on image sequences without a robot: a folder, a video, image files, or a bag.

The camera's motion is estimated from the images, with the help of a gyro's record, poses or the
speed if they are given. Where this is not sufficient the result is "unknown".
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
