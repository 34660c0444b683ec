from .growing_map import GrowingMap as GrowingMap
from .growing_map import GrowingMapParams as GrowingMapParams
from .joining import join as join
from .map_making import cleaned_grid as cleaned_grid
from .map_making import made_map as made_map
from .map_making import with_place as with_place
