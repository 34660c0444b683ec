from .free_distances import Arcs as Arcs
from .free_distances import Ranges as Ranges
from .local_map import LocalMap as LocalMap
from .local_map import LocalMapParams as LocalMapParams
from .local_planner import LocalGoal as LocalGoal
from .occupancy_grid import CLAMP_MAX as CLAMP_MAX
from .occupancy_grid import CLAMP_MIN as CLAMP_MIN
from .occupancy_grid import OccupancyGrid as OccupancyGrid
