"""Frames made ready for the stages: straight, reduced, and made level where the body rocks.

All that is known of the floor, of heights and of bearings supposes a level camera of fixed pitch.
"""

from __future__ import annotations

from dataclasses import replace

from navfw.camera_geometry.image_reduction import reduce_frame
from navfw.egomotion.camera_motions import pitch_rotation
from navfw.egomotion.odometer import OdometryHistory
from navfw.flow.aligned_past import align_past
from navfw.lenses import Undistortion
from navfw.numerics import Image
from navfw.numerics.products import product
from navfw.robot import CameraModel, RobotModel
from navfw.signals import Frame, SensorReading


def straight_reading(reading: SensorReading, lens: Undistortion | None) -> SensorReading:
    """``reading`` with its frame as a pinhole camera would show it; nothing without a ``lens``.

    A frame of another size than the camera's stays: the flow refuses it. Side views and landmark
    frames are straight already.
    """
    frame = reading.frame
    if lens is None or frame is None or frame.image.shape != lens.shape:
        return reading
    return replace(reading, frame=replace(frame, image=lens.apply(frame.image)))


def ready_frame(
    frame: Frame | None, robot: RobotModel, factor: int, history: OdometryHistory
) -> Frame | None:
    """``frame`` reduced by ``factor``, as a level camera of the reduced ``robot`` would take it.

    The pitch is that of the time of the frame in ``history``.
    """
    if frame is None:
        return None
    frame = reduce_frame(frame, factor)
    pitch = history.at(frame.time).pitch
    if pitch == 0.0:
        return frame
    sides = zip(frame.sides, robot.side_cameras, strict=True)
    return Frame(
        frame.time,
        _level(frame.image, robot.camera, pitch),
        tuple(_level(side, camera, pitch) for side, camera in sides),
    )


def _level(image: Image, camera: CameraModel, pitch: float) -> Image:
    """``image`` of a camera on a body of this pitch, as if it had turned back."""
    axes = camera.base_from_camera
    return align_past(image, product(axes.T, pitch_rotation(pitch), axes), camera)
