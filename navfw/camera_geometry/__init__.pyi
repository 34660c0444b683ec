from .image_reduction import reduce_frame as reduce_frame
from .rotations import derotate as derotate
from .rotations import rotate_points as rotate_points
from .rotations import rotation_matrix as rotation_matrix
from .rotations import rotation_vector as rotation_vector
from .rotations import turn_point as turn_point
from .rotations import turning_slope as turning_slope
from .rotations import undo_turn as undo_turn
