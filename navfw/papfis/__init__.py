"""PAPFIS (paper sec 2: path planning FIS): fuzzy edge costs, A* search, waypoints, replanning.

``edge_costs`` infers the passages' costs, ``access`` connects start and goal to the map,
``graph_search`` and ``routes`` find the cheapest route, ``waypoints`` and ``tour`` follow it goal
by goal, ``blockages`` closes and reopens passages. ``papfis`` is the planner plugin, ``route_plan``
plans a single route without a mission.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
