"""Optical Flow Processor (paper sec 3): flow on a sparse grid, its confidence, and derotation."""

import cv2
import lazy_loader

# OpenCV runs in one thread: the stack is made for one core, results must not depend on how the work
# is divided, and for images of this size starting threads costs more time than they save.
cv2.setNumThreads(1)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
