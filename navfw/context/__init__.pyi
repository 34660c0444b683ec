from .decision_context import CommandGrid as CommandGrid
from .decision_context import CommandGridParams as CommandGridParams
from .decision_context import Context as Context
from .decision_context import peak as peak
