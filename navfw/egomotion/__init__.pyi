from .odometer import Odometer as Odometer
from .pairing import seeing_speed as seeing_speed
