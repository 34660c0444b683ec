"""Gymnasium environments over navfw's worlds and missions; importing it registers their ids.

>>> import gymnasium                                                         # doctest: +SKIP
>>> import navfw.gym                                                         # doctest: +SKIP
>>> env = gymnasium.make("navfw/Rooms-v0", observation="local_map")          # doctest: +SKIP
>>> observation, info = env.reset(seed=1000)                                 # doctest: +SKIP

``navfw/Rooms-v0``, and so on for each shipped family, make a world for every seed;
``navfw/Mission-v0`` takes ``world`` and ``mission``. All other parameters are those of
``navfw.gym.mission_env.MissionEnv``.
"""

import lazy_loader

from navfw.config.extras import extra_imports
from navfw.plugins import BUILT_IN

with extra_imports("gym", key="navfw.gym"):
    import gymnasium

_VERSION = 0
"""Version of the ids, raised when results become incomparable by changed worlds or rewards."""

_CLASS = "navfw.gym.mission_env:MissionEnv"

IDS = {
    f"navfw/{family.capitalize()}-v{_VERSION}": {"family": family} for family in BUILT_IN["family"]
} | {f"navfw/Mission-v{_VERSION}": {}}
"""The ids of the environments, each with the parameters that it fixes."""

MAX_STEPS = 6000
"""Largest number of steps, 10 min: longer than the time limit of any family's mission."""

for _id, _parameters in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(_id, entry_point=_CLASS, kwargs=_parameters, max_episode_steps=MAX_STEPS)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["IDS", "MAX_STEPS"]
