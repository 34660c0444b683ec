"""Effects of a real camera on its images, as settings of a robot; without any, images are ideal.

Light falls off towards the image's corners, is collected while the robot moves, and its amount is
controlled; rows are read out one after the other, and the image is compressed. The simulator
applies them in this order (``navfw.sim.shutter``, ``navfw.sim.shutter``). The stack does not
correct them.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

ShutterTime = Annotated[float, Field(ge=0.0, le=0.2)]
"""[s]; of a frame: a camera of 5 Hz has 0.2 s for it."""


class AutoExposure(BaseModel):
    """Exposure control: brings the image's mean grey value to a target.

    Too bright, it shortens the exposure time; too dark, it amplifies image and noise.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    target: Annotated[
        float, Field(ge=20.0, le=235.0, description="mean grey value of the image [0 to 255]")
    ] = 110.0
    time: Annotated[
        float, Field(ge=0.01, le=30.0, description="time constant of the control [s]")
    ] = 0.4
    max_gain: Annotated[
        float, Field(ge=1.0, le=64.0, description="largest amplification of image and noise")
    ] = 8.0


class CameraEffects(BaseModel):
    """What a real camera does to its images; all effects are off by default."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    auto_exposure: Annotated[
        AutoExposure | None, Field(description="exposure control; none: the exposure is fixed")
    ] = None
    exposure_time: Annotated[
        ShutterTime, Field(description="longest exposure of a row: motion blur [s]")
    ] = 0.0
    readout_time: Annotated[
        ShutterTime,
        Field(description="from the first row's exposure to the last one's: rolling shutter [s]"),
    ] = 0.0
    vignetting: Annotated[
        float,
        Field(
            ge=0.0,
            le=0.95,
            description="share of the light lost at the corner of the view; grows with the square"
            " of the angle from the optical axis",
        ),
    ] = 0.0
    jpeg_quality: Annotated[
        Annotated[int, Field(ge=1, le=100)] | None,
        Field(description="of JPEG compression; none: not compressed"),
    ] = None

    @property
    def shutter_time(self) -> float:
        """Time [s] from the begin of the first row's exposure to the end of the last one's."""
        return self.exposure_time + self.readout_time
