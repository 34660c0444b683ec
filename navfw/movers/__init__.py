"""Moving objects: detection and tracking (DATMO), and prediction of conflicts with commands.

The data flow in one direction, from image cells to predicted conflicts:

1. ``RecentFrames`` pairs the newest frame with one 0.2 s older (0.1 s for near objects), and
   ``navfw.flow.floor_aligned`` gives dense flow of the image below the horizon.
2. ``motion_segmentation`` marks cells whose flow no static point can have.
3. ``localization`` makes one detection of each connected region: bearing, distance by the foot
   point on the floor, velocity by the flow.
4. ``multi_view`` runs 1 to 3 for each view of the lens as its ``DetectionSchedule`` asks: full,
   coarse or idle; an object that shows in two of them is joined.
5. ``tracking`` associates detections with tracks in the odom frame (gated cost, Kalman filter with
   constant velocity) and confirms them.
6. ``conflict_prediction`` moves robot and tracks on together and gives, for every command, distance
   and time at closest approach.

``stixels`` uses the same dense flow for static obstacles: thin poles, by image columns;
``low_things`` compares the floor with that of an image farther back.

Vision runs 1 to 4; the stack owns the tracker and the predictor and hands their result to MOFIS,
the discs that tracks occupy to the local map.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
