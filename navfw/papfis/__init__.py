"""PAPFIS, the path planning FIS: fuzzy edge costs, A*, waypoints."""

from __future__ import annotations

from navfw.papfis.edge_costs import CostParams, EdgeCosts
from navfw.papfis.papfis import Papfis
from navfw.papfis.route_plan import Plan, make_plan
from navfw.papfis.routes import Route, Router, Spot

__all__ = ["CostParams", "EdgeCosts", "Papfis", "Plan", "Route", "Router", "Spot", "make_plan"]
