"""A ring of four corridors with landmarks on its walls."""

from __future__ import annotations

import math

from localization_drives import corridor_landmarks

from navfw.signals import Pose
from navfw.topomap import Passage, Place, TopoMap

RING = [(0.0, 0.0), (14.0, 0.0), (14.0, 8.0), (0.0, 8.0), (0.0, 0.0)]
CORNERS = [Place(f"corner-{i}", *point) for i, point in enumerate(RING[:4])]
SIDES = [
    Passage(a.name, b.name, math.hypot(a.x - b.x, a.y - b.y), 2.0)
    for a, b in zip(CORNERS, [*CORNERS[1:], CORNERS[0]], strict=True)
]
MARKS = corridor_landmarks(RING)
HALL = TopoMap("ring", CORNERS, SIDES, landmarks=MARKS)
START = Pose(0.0, 0.0, 0.0)
