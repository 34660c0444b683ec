from .growing_map import GrowingMap as GrowingMap
from .joining import join as join
from .map_changes import MapChange as MapChange
from .map_changes import changes_between as changes_between
from .map_making import corrected_map as corrected_map
from .map_making import made_map as made_map
from .map_making import with_place as with_place
