"""The local map: what is known of the floor within a few metres, in the odom frame.

A library without plugins. ``LocalMap`` joins its parts:

- ``occupancy_grid``: the rolling grid of log-odds, built from percepts and stixels;
- ``free_distances``: free distance along arcs and all around, by ``ray_kernels``;
- ``local_planner``: cost-to-go and the local goal, by ``cost_kernels``;
- ``traversability``: whether the passages ahead are open.

The stack updates it. MOFIS, the safety monitor and the stack's passage check query it. A map that
has not been updated yet offers no room at all.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
