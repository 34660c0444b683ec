from .command_grid import CommandGrid as CommandGrid
from .command_grid import CommandGridParams as CommandGridParams
from .command_grid import peak as peak
from .decision_context import Context as Context
from .decision_context import QuadrantDistances as QuadrantDistances
from .decision_context import quadrant_distances as quadrant_distances
