"""Simulator: worlds, physics, rendering and sensor models; the only package that uses PyBullet.

``worldspec`` specifies a world, ``world_check`` checks it, ``worldfile`` loads it. ``Simulation``
runs a robot in a world; ``SceneGeometry`` is the world's true geometry in the plane. ``Simulation``
is imported on first access, since the geometry needs no physics engine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfw.lazy_names import first_access
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.sensor_models import SensorParams
from navfw.sim.worldfile import load_world
from navfw.sim.worldspec import WorldSpec

if TYPE_CHECKING:
    from navfw.sim.simulation import Simulation

__all__ = ["SceneGeometry", "SensorParams", "Simulation", "WorldSpec", "load_world"]


def __getattr__(name: str) -> Any:
    return first_access(__name__, name, {"Simulation": "navfw.sim.simulation"})
