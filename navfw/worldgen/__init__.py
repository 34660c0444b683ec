"""World generation by family, seed and difficulty, and import of Gazebo worlds.

>>> made = generate("clutter", seed=3, difficulty=0.4)
>>> made.world.name, made.mission.timeout > 0.0
('clutter-3', True)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
