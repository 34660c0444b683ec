from .camera_models import CameraEffects as CameraEffects
from .camera_models import CameraModel as CameraModel
from .camera_models import SideViews as SideViews
from .robot_model import DrivenUrdf as DrivenUrdf
from .robot_model import Footprint as Footprint
from .robot_model import OdometrySheet as OdometrySheet
from .robot_model import RobotModel as RobotModel
from .robotfile import load_robot as load_robot
