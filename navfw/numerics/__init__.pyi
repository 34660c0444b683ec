from .arrays import Array as Array
from .arrays import Image as Image
from .arrays import Mask as Mask
