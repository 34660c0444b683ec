"""Sensor readings, the only input of a stack beside the map file; egomotion and optical flow."""

from __future__ import annotations

import math
from dataclasses import dataclass

from navfw.numerics.arrays import Array, Image
from navfw.numerics.products import product
from navfw.signals.geometry import Pose, Twist
from navfw.signals.immutability import Frozen


@dataclass(frozen=True, slots=True)
class Frame(Frozen):
    """One camera image: ``image`` (height, width) uint8 luminance, taken at ``time`` [s].

    ``sides`` are the left and right side views of the same time, if the robot has a wider lens
    (``navfw.robot.SideViews``).
    """

    time: float
    image: Image
    sides: tuple[Image, ...] = ()


@dataclass(frozen=True, slots=True)
class Inertial:
    """Rate gyro: angular velocity [rad/s] about base_link x, y, z (roll, pitch, yaw rate).

    Each rate is the mean since the last reading; NaN for an axis that the gyro does not measure.
    """

    time: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class Encoders:
    """Wheel encoders: signed ticks since power-on, increasing while the wheel rolls forward."""

    time: float
    left: int
    right: int


@dataclass(frozen=True, slots=True)
class SensorReading:
    """All sensor readings of one control tick; ``frame`` is None when the camera delivered none.

    ``landmark_frame`` is a larger image at a lower rate for landmark recognition, if configured.
    """

    time: float
    inertial: Inertial
    encoders: Encoders
    frame: Frame | None = None
    landmark_frame: Frame | None = None


@dataclass(frozen=True, slots=True)
class Odometry:
    """Dead reckoning from encoders and gyro: pose in ``odom``, measured twist.

    ``still`` is true while neither wheel has turned for a moment: then the gyro's bias is estimated
    (``yaw_bias`` [rad/s], already removed from the pose and twist). ``silent`` is true while the
    encoders do not follow the commanded wheel speeds, so that the distance driven is a guess;
    ``gyro_stale`` while the yaw rate is the wheels', for want of a fresh gyro reading; ``by_floor``
    while the distance driven is measured by the floor's motion in the images. ``doubt`` says why
    the floor's motion is not used, or is empty. ``pitch`` [rad], nose down, is that of a body that
    rocks, ``rocking`` [rad] its amplitude; both are 0 for a body that does not rock.
    """

    time: float
    pose: Pose
    twist: Twist
    yaw_bias: float
    still: bool
    silent: bool = False
    gyro_stale: bool = False
    by_floor: bool = False
    doubt: str = ""
    pitch: float = 0.0
    rocking: float = 0.0


@dataclass(frozen=True, slots=True)
class CameraMotion(Frozen):
    """How the camera moved from a past frame to the current one.

    ``rotation`` (3, 3) turns vectors given in the past camera's axes into the current camera's
    axes; ``translation`` (3,) [m] is the camera's displacement, current minus past position, in
    the CURRENT camera's axes. A static point obeys ``X_now = rotation @ X_past - translation``.
    ``yaw_sigma`` [rad] and ``translation_sigma`` [m] are one standard deviation, ``skid_sigma`` [m]
    is the part of the latter that skidding wheels add in turns, sideways.
    """

    rotation: Array
    translation: Array
    dt: float
    yaw_sigma: float = 0.0
    translation_sigma: float = 0.0
    skid_sigma: float = 0.0

    @property
    def baseline(self) -> float:
        """Length [m] of the translation."""
        return math.sqrt(product(self.translation, self.translation))


@dataclass(frozen=True, slots=True)
class FramePair:
    """Two frames with enough translation between them to measure flow, and the camera's motion."""

    past: Frame
    now: Frame
    motion: CameraMotion


@dataclass(frozen=True, slots=True)
class YawCorrection:
    """An error that the flow found in the yaw of the measured ``motion`` of one pair of frames.

    The robot turned by ``yaw`` [rad] more, counter-clockwise, than ``motion`` has it; ``sigma``
    [rad] is the standard deviation. The stack applies it to the odometer.
    """

    yaw: float
    sigma: float
    motion: CameraMotion


@dataclass(frozen=True, slots=True)
class FlowField(Frozen):
    """Optical flow on a regular sparse grid over the CURRENT image (paper sec 3).

    ``points`` (rows, cols, 2) [px, relative to the principal point] are the grid points in the
    current image; ``vectors`` (rows, cols, 2) [px] are the shifts of the imaged points since the
    past frame (``now - past``: forward motion makes vectors point away from the focus of
    expansion). ``confidence`` (rows, cols) in [0, 1]; 0 means the vector says nothing. ``sigma``
    (rows, cols) [px] is the standard deviation of each component of a vector. ``derotated`` is true
    if the part due to camera rotation has been removed. ``inconsistency`` (rows, cols) in [0, 1],
    if known: the confidence of a vector whose epipolar residual no static point explains, 0
    elsewhere.
    """

    time: float
    points: Array
    vectors: Array
    confidence: Array
    sigma: Array
    motion: CameraMotion
    derotated: bool = False
    inconsistency: Array | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Size (rows, cols) of the grid."""
        return self.confidence.shape[0], self.confidence.shape[1]
