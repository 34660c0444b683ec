from .trim import MIN_DISTANCE as MIN_DISTANCE
from .trim import MIN_SHARE as MIN_SHARE
from .trim import TIME_CONSTANT as TIME_CONSTANT
from .trim import WINDOW as WINDOW
from .trim import WheelTrim as WheelTrim
from .unicycle import Unicycle as Unicycle
