from .landmark_appearance import landmark_kind as landmark_kind
from .landmark_appearance import marker_dictionary as marker_dictionary
from .recognizers import Aruco as Aruco
from .recognizers import NoFeatures as NoFeatures
from .recognizers import is_upright as is_upright
from .recognizers import locate as locate
from .recognizers import locate_with_covariance as locate_with_covariance
