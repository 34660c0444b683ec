"""Model cameras: image size, lens and mounting, and effects of real cameras on their images.

Without effects images are ideal. Light falls off towards the image's corners, is collected while
the robot moves, and its amount is controlled; rows are read out one after the other, and the image
is compressed. The simulator (``navfw.sim.camera_rig``) applies these effects in this order; the
stack does not correct them. For a camera with a calibration it assumes wider sigmas of flow.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, model_validator

from navfw.config.strict_model import StrictModel
from navfw.errors import InputError
from navfw.numerics import Array
from navfw.numerics.products import product

if TYPE_CHECKING:
    from navfw.lenses import Undistortion

RATES = (0.1, 60.0)  # chosen
"""Least and largest ``Rate`` [Hz]."""
Rate = Annotated[float, Field(ge=RATES[0], le=RATES[1])]
"""Rate of frames [Hz]; a slower camera sees nothing in time, a faster one is not simulated."""

_WORKING_WIDTH = 160  # defined
"""Least width [px] of the images that flow and perception work on: the paper's."""


CELLS = 16, 12  # chosen
"""Columns and rows of the usual grid of flow vectors."""


_Entry = Annotated[float, Field(ge=-1e6, le=1e6)]
_Side = Annotated[int, Field(ge=1, le=20_000)]


class LensCalibration(StrictModel):
    """A lens's calibration as part of a robot (see ``navfw.lenses.CameraCalibration``)."""

    file: str = Field(description="where it was read")
    model: str = Field(description="of the distortion, as OpenCV calls it")
    matrix: tuple[_Entry, ...] = Field(min_length=9, max_length=9, description="[px]")
    coefficients: tuple[_Entry, ...] = Field(max_length=14, description="in its order")
    size: tuple[_Side, _Side] | None = Field(default=None, description="of its images [px]")

    @classmethod
    def load(cls, path: Path) -> LensCalibration:
        """Load the calibration file at ``path``; see ``navfw.lenses.load_calibration``."""
        from navfw.lenses import load_calibration

        read = load_calibration(path)
        return cls(
            file=read.file,
            model=read.model,
            matrix=tuple(read.matrix.ravel().tolist()),
            coefficients=tuple(read.coefficients.tolist()),
            size=read.size,
        )


class CameraModel(StrictModel):
    """A camera fixed to base_link, looking forward (camera_optical: x right, y down).

    To the stack it is a pinhole camera: with a calibration the stack removes the distortion of its
    images, and ``hfov`` is that of the undistorted images.
    """

    width: int = Field(default=160, ge=32, le=1920, description="image width [px]")
    height: int = Field(default=120, ge=24, le=1080, description="image height [px]")
    hfov: float = Field(
        default=math.radians(90.0), gt=0.2, lt=2.8, description="horizontal field of view [rad]"
    )
    mount_height: float = Field(default=0.35, ge=0.01, le=60.0, description="above the floor [m]")
    mount_forward: float = Field(
        default=0.10, ge=-2.0, le=2.0, description="ahead of the wheel axle [m]"
    )
    pitch: float = Field(default=0.0, gt=-1.0, lt=1.0, description="nose-down positive [rad]")
    rate: Rate = Field(default=10.0, description="frames per second [Hz]")
    calibration: LensCalibration | str | None = Field(
        default=None,
        description="calibration file of a lens with distortion (ROS, OpenCV), relative to the"
        " robot file: the stack makes images straight; gives `hfov`",
    )

    @model_validator(mode="after")
    def _as_wide_as_its_lens(self) -> CameraModel:
        try:
            if isinstance(self.calibration, str):
                self.__dict__["calibration"] = LensCalibration.load(Path(self.calibration))
            straight = self.undistortion()
        except InputError as error:
            raise ValueError(str(error)) from None
        if straight is not None:
            self.__dict__["hfov"] = straight.hfov
        return self

    def undistortion(self) -> Undistortion | None:
        """Make the object that removes this camera's distortion; None without a calibration."""
        lens = self.calibration
        if not isinstance(lens, LensCalibration):
            return None
        from navfw.lenses import CameraCalibration, Undistortion

        read = CameraCalibration(
            lens.file,
            np.array(lens.matrix).reshape(3, 3),
            np.array(lens.coefficients),
            lens.model,
            lens.size,
        )
        return Undistortion(read, self.width, self.height, key=None)

    @property
    def focal(self) -> float:
        """Focal length [px], the same for both axes."""
        return 0.5 * self.width / math.tan(0.5 * self.hfov)

    @property
    def base_from_camera(self) -> Array:
        """Rotation (3, 3) that turns camera_optical axes into base_link axes."""
        c, s = math.cos(self.pitch), math.sin(self.pitch)
        # columns: the camera's x (right), y (down) and z (forward) axes, in base_link
        return np.array([[0.0, -s, c], [-1.0, 0.0, 0.0], [0.0, -c, -s]])

    @property
    def reduction(self) -> int:
        """Factor by which the stack reduces images: the largest that leaves a width of 160 px.

        The reduced images divide into the cells of CELLS; 1 if none of that width do. The pixels of
        flow fields and percepts are those of the reduced image.
        """
        parts = math.gcd(self.width // CELLS[0], self.height // CELLS[1])
        if self.width % CELLS[0] or self.height % CELLS[1]:
            return 1
        factors = range(self.width // _WORKING_WIDTH, 1, -1)
        return next((factor for factor in factors if parts % factor == 0), 1)

    @property
    def floor_in_view_from(self) -> float:
        """Least horizontal distance [m] from the camera of floor in view; inf if none is."""
        edge = np.array([0.0, 0.5 * self.height])
        fall = float(self.fall_per_depth(edge))
        ahead = math.cos(self.pitch) - edge[1] / self.focal * math.sin(self.pitch)
        return float(self.mount_height * ahead / fall) if fall > 0.0 else math.inf

    def fall_per_depth(self, points: Array, pitch: float | None = None) -> Array:
        """Compute the fall [m] per metre of depth of rays through ``points`` (..., 2).

        ``points`` are in px from the image's centre; ``pitch`` [rad], if given, replaces the
        camera's.
        """
        focal = self.focal
        tilt = self.pitch if pitch is None else pitch
        result: Array = (points[..., 1] * math.cos(tilt) + focal * math.sin(tilt)) / focal
        return result

    @property
    def bearing(self) -> float:
        """Bearing of the optical axis [rad from ahead, left positive]."""
        x, y = self.base_from_camera[:2, 2].tolist()
        return math.atan2(y, x)


class SideCamera(CameraModel):
    """A virtual pinhole camera turned to one side: a part of a wide lens's image, undistorted."""

    turn: float = Field(description="of the axis from ahead, left positive [rad]")

    @property
    def base_from_camera(self) -> Array:
        """Rotation (3, 3) that turns camera_optical axes into base_link axes."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(product(turn, super().base_from_camera))


class SideViews(StrictModel):
    """Two more images, left and right of the camera's own, from a lens that shows more.

    They are as high as the camera's image, with its focal length, and taken at the same times. They
    are used to detect moving objects; OFFIS uses only the camera's image.
    """

    width: int = Field(default=80, ge=32, le=640, description="of each image [px]")
    overlap: float = Field(
        default=math.radians(5.0),
        ge=0.0,
        le=0.5,
        description="part of the camera's image seen again [rad]",
    )


class LandmarkCamera(StrictModel):
    """Mode of the camera for landmark frames: a wide, low image at a lower rate.

    Landmarks hang at about the camera's height, so a band around the image's middle holds them.
    """

    width: int = Field(default=480, ge=64, le=3840, description="image width [px]")
    height: int = Field(default=96, ge=32, le=2160, description="image height [px]")
    rate: Rate = Field(default=1.25, description="frames per second [Hz]")


ShutterTime = Annotated[float, Field(ge=0.0, le=0.2)]
"""[s]; of a frame: a camera of 5 Hz has 0.2 s for it."""


class AutoExposure(StrictModel):
    """Exposure control: brings the image's mean grey value to a target.

    It shortens the exposure of images that are too bright; it amplifies dark ones, with their
    noise.
    """

    target: float = Field(
        default=110.0, ge=20.0, le=235.0, description="mean grey value of the image [0 to 255]"
    )
    time: float = Field(
        default=0.4, ge=0.01, le=30.0, description="time constant of the control [s]"
    )
    max_gain: float = Field(
        default=8.0, ge=1.0, le=64.0, description="largest amplification of image and noise"
    )


class CameraEffects(StrictModel):
    """Effects of a real camera on its images; all are off by default."""

    auto_exposure: AutoExposure | None = Field(
        default=None, description="exposure control; none: the exposure is fixed"
    )
    exposure_time: ShutterTime = Field(
        default=0.0, description="longest exposure of a row: motion blur [s]"
    )
    readout_time: ShutterTime = Field(
        default=0.0,
        description="from the first row's exposure to the last one's: rolling shutter [s]",
    )
    vignetting: float = Field(
        default=0.0,
        ge=0.0,
        le=0.95,
        description="share of the light lost at the corner of the view; grows with the square"
        " of the angle from the optical axis",
    )
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None, description="of JPEG compression; none: not compressed"
    )

    @property
    def shutter_time(self) -> float:
        """Time [s] from the start of the first row's exposure to the end of the last one's."""
        return self.exposure_time + self.readout_time
