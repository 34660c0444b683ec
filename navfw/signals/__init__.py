"""What passes between the rooms: small frozen dataclasses, one per arrow of the data flow.

Conventions (all of navfw): SI units and radians. Frames after REP-103/105: ``map``, ``odom`` and
``base_link`` have x forward, y left, z up, yaw counter-clockwise; ``camera_optical`` has z
forward, x right, y down. Image points are in pixels relative to the principal point (x right,
y down). Arrays over the grid have shape (rows, cols) with row 0 at the top of the image and column
0 at its left. Nearness is 1/Z [1/m], Z the depth along the optical axis.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
