"""OFFIS on image sequences without a robot or odometry: a folder, a video, or image files.

The camera's motion is estimated from the images, with the help of what is given (a gyro's record,
poses, the speed). Where this is not sufficient the result is "unknown".
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
