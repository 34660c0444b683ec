"""PAPFIS (paper sec 2: path planning FIS): fuzzy edge costs, A* search, waypoints, replanning.

``edge_costs`` infers the passages' costs, ``access`` connects start and goal to the map,
``graph_search`` and ``routes`` find the cheapest route, ``waypoints`` and ``tour`` follow it goal
by goal, ``blockages`` closes and reopens passages. ``papfis`` is the planner plugin, ``route_plan``
plans a single route without a mission.
"""

from __future__ import annotations

from navfw.papfis.edge_costs import CostParams, EdgeCosts
from navfw.papfis.papfis import Papfis
from navfw.papfis.route_plan import RoutePlan, plan_route
from navfw.papfis.routes import Endpoint, Route, Router

__all__ = [
    "CostParams",
    "EdgeCosts",
    "Endpoint",
    "Papfis",
    "Route",
    "RoutePlan",
    "Router",
    "plan_route",
]
