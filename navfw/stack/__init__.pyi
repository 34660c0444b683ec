from .stack import TIMED as TIMED
from .stack import Stack as Stack
