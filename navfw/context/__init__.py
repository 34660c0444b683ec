"""The context of a decision: what behaviours know, and the commands they choose from.

Plain data that the stack hands to the plugins of MOFIS; it depends on signals, robot and local map
alone, so that interfaces and MOFIS share it without a circle.
"""

from __future__ import annotations

from navfw.context.command_grid import CommandGrid, CommandGridParams, peak
from navfw.context.decision_context import Context, QuadrantDistances, quadrant_distances

__all__ = [
    "CommandGrid",
    "CommandGridParams",
    "Context",
    "QuadrantDistances",
    "peak",
    "quadrant_distances",
]
