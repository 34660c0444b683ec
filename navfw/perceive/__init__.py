"""OFFIS on images from anywhere: a folder, a video, image files; no robot, no odometry.

What a robot would know of its motion is assumed (straight ahead), given (speed, gyro) or taken from
the flow itself; where that does not suffice the answer is "unknown".
"""
