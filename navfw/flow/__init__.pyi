from .grid_flow import grid_points as grid_points
