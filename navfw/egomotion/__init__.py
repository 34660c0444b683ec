"""Motion of the robot and its camera from wheel encoders and gyro alone (paper sec 2, AUX)."""

from __future__ import annotations

from navfw.egomotion.camera_motion import camera_motion
from navfw.egomotion.odometer import Odometer, OdometryHistory
from navfw.egomotion.pairing import FrameBuffer, PairingParams, seeing_speed

__all__ = [
    "FrameBuffer",
    "Odometer",
    "OdometryHistory",
    "PairingParams",
    "camera_motion",
    "seeing_speed",
]
