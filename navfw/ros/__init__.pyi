from .bags_replay import BagReadings as BagReadings
from .bags_replay import BagReplay as BagReplay
from .bags_replay import driven_map as driven_map
from .connection import RosNode as RosNode
from .drive_node import DriveNode as DriveNode
from .drive_node import DriveOptions as DriveOptions
from .robot_node import RosPilot as RosPilot
from .sensor_inputs import goal_at as goal_at
