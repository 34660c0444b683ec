"""Optical Flow Processor (paper sec 3): flow on a sparse grid, its confidence, and derotation."""

from __future__ import annotations

import cv2

# One thread for all of OpenCV: the stack is meant to fit on one core, results must not depend on
# how work is divided, and for images this small waking other threads costs more than it gains.
cv2.setNumThreads(1)
