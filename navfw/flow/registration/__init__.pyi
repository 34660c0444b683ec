from .roughness_kernels import roughness as roughness
from .windows import Registration as Registration
from .windows import grid_windows as grid_windows
from .windows import register_windows as register_windows
