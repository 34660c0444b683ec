"""The simulator: worlds, physics, rendering and sensor models; only this package uses PyBullet.

``worldspec`` specifies a world, ``world_check`` checks it, ``worldfile`` loads it. ``Simulation``
runs a robot in a world; ``SceneGeometry`` is the world's true geometry in the plane. Names are
imported on first access, since the geometry needs no physics engine.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
