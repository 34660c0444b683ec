"""Dense inverse search (DIS) flow, averaged over the grid's cells."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import cv2
import numpy as np
from pydantic import Field

from navfw.flow.dense_flow import DenseFlow
from navfw.numerics import Image
from navfw.numerics.arrays import Floats
from navfw.robot import RobotModel

_PRESETS = {
    "ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    "fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
    "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}


class Dis(DenseFlow):
    """OpenCV's dense inverse search (DIS) flow, one mean vector per grid cell (METHOD 2.7)."""

    name: ClassVar[str] = "dis"

    class Params(DenseFlow.Params):
        """Grid, limits of the confidence (METHOD 2.9), and OpenCV's settings."""

        preset: Annotated[
            Literal["ultrafast", "fast", "medium"], Field(description="OpenCV's preset")
        ] = "ultrafast"
        finest_scale: Annotated[
            int, Field(ge=0, le=3, description="finest pyramid level, in halvings of the image")
        ] = 0

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        super().__init__(robot, params)
        self._dis = cv2.DISOpticalFlow.create(_PRESETS[self.params.preset])
        self._dis.setFinestScale(self.params.finest_scale)

    def _dense(self, now: Image, past: Image) -> Floats:
        start: Floats = np.zeros((*now.shape, 2), dtype=np.float32)
        return np.asarray(self._dis.calc(now, past, start), dtype=np.float32)
