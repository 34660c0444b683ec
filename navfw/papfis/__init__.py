"""PAPFIS (paper sec 2: path planning FIS): fuzzy edge costs, A* search, waypoints, replanning.

``edge_costs`` infers the passages' costs, ``access`` connects start and goal to the map,
``routes`` finds the cheapest route, ``tour`` follows it goal by goal. ``papfis`` is the planner
plugin, which also closes and reopens passages; ``route_plan`` plans a single route without a
mission.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
