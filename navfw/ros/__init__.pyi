from .bags_replay import BagReplay as BagReplay
from .bags_replay import driven_map as driven_map
