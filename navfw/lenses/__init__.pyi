from .calibration_file import load_calibration as load_calibration
from .lens_models import ARCTAN as ARCTAN
from .lens_models import CURVATURES as CURVATURES
from .lens_models import CameraCalibration as CameraCalibration
from .lens_models import LensShape as LensShape
from .lens_models import Undistortion as Undistortion
from .lens_models import focal_for as focal_for
