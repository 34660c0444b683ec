from .scene_geometry import SceneGeometry as SceneGeometry
from .sensor_models import SensorParams as SensorParams
from .simulation import Simulation as Simulation
from .worldfile import load_world as load_world
from .worldspec import WorldSpec as WorldSpec
