from .elements import PLACE_KINDS as PLACE_KINDS
from .elements import Landmark as Landmark
from .elements import Passage as Passage
from .elements import Place as Place
from .elements import PlaceKind as PlaceKind
from .mapfile import load_map as load_map
from .topological_map import PassageProjection as PassageProjection
from .topological_map import TopoMap as TopoMap
