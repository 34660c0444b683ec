from .bag_source import camera_contradiction as camera_contradiction
from .overlay import draw_flow as draw_flow
