"""OFFIS on image sequences without a robot or odometry: a folder, a video, or image files.

The camera's motion is assumed (straight ahead), given (speed, a gyro's record, poses) or estimated
from the flow itself. Where this is not sufficient the result is "unknown".
"""
