"""Motion of the robot and its camera from encoders, gyro, and the images (paper sec 2, AUX)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
