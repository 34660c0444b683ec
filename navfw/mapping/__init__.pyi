from .growing_map import GrowingMap as GrowingMap
from .growing_map import GrowingMapParams as GrowingMapParams
