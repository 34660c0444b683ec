from .bags_readings import BagReadings as BagReadings
from .bags_readings import driven_map as driven_map
from .bags_replay import BagReplay as BagReplay
