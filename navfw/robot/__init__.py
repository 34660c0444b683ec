"""The robot: its model, robot files and URDFs, cameras; shared by stack and simulator."""

from __future__ import annotations

from navfw.robot.camera_models import CameraModel, LandmarkCamera, SideCamera, SideViews
from navfw.robot.robot_model import DrivenUrdf, Footprint, OdometrySheet, RobotModel

__all__ = [
    "CameraModel",
    "DrivenUrdf",
    "Footprint",
    "LandmarkCamera",
    "OdometrySheet",
    "RobotModel",
    "SideCamera",
    "SideViews",
]
