from .unicycle import MIN_DISTANCE as MIN_DISTANCE
from .unicycle import MIN_SHARE as MIN_SHARE
from .unicycle import TIME_CONSTANT as TIME_CONSTANT
from .unicycle import WINDOW as WINDOW
from .unicycle import Unicycle as Unicycle
from .unicycle import WheelTrim as WheelTrim
