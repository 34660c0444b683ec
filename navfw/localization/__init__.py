"""Localisers (METHOD 4.4): the robot's pose in the map and the place posterior.

``dead_reckoning`` uses odometry only. ``topological`` finds an unknown start by a discrete filter
(``discrete_filter`` over a ``lattice``) and tracks the pose by a metric one
(``metric_filter``). Landmark detections become observations, weighted by
each landmark's existence probability (``landmark_model``); OFFIS' situations enter by
``place_probabilities``. ``floor_plan`` matches the walls that are seen to the map's floor plan
(``plan_field``), and searches it for an unknown start (``plan_search``).
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
