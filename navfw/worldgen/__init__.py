"""World generation by family, seed and difficulty, and import of Gazebo worlds.

>>> made = generate("clutter", seed=3, difficulty=0.4)
>>> made.world.name, made.mission.timeout > 0.0
('clutter-3', True)
"""

from __future__ import annotations

from navfw.worldgen.generated_world import GeneratedWorld
from navfw.worldgen.generation import FAMILIES, generate

__all__ = ["FAMILIES", "GeneratedWorld", "generate"]
