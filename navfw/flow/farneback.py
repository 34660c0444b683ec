"""Farneback's flow by polynomial expansion, averaged over the grid's cells."""

from __future__ import annotations

from typing import Annotated, ClassVar

import cv2
import numpy as np
from pydantic import Field

from navfw.flow.dense_flow import DenseFlow
from navfw.numerics import Image
from navfw.numerics.arrays import Floats


class Farneback(DenseFlow):
    """OpenCV's Farneback flow, one mean vector per grid cell (Farneback 2003).

    Each neighbourhood of both images is approximated by a quadratic polynomial; the displacement
    follows from the change of its coefficients, from coarse to fine levels of a pyramid.
    """

    name: ClassVar[str] = "farneback"

    class Params(DenseFlow.Params):
        """Grid, limits of the confidence (METHOD 2.9), and OpenCV's settings."""

        levels: Annotated[int, Field(ge=1, le=6, description="levels of the image pyramid")] = 3
        window: Annotated[int, Field(ge=5, le=63, description="averaging window [px]")] = 9
        iterations: Annotated[int, Field(ge=1, le=10, description="iterations at each level")] = 3
        neighbourhood: Annotated[
            int, Field(ge=5, le=9, description="side of the polynomials' support [px]")
        ] = 5

    params: Params

    def _dense(self, now: Image, past: Image) -> Floats:
        p = self.params
        start: Floats = np.zeros((*now.shape, 2), dtype=np.float32)
        flow = cv2.calcOpticalFlowFarneback(
            now,
            past,
            start,
            pyr_scale=0.5,
            levels=p.levels,
            winsize=p.window,
            iterations=p.iterations,
            poly_n=p.neighbourhood,
            # as OpenCV recommends: 1.1 for 5 px, 1.5 for 7 px
            poly_sigma=0.2 * p.neighbourhood + 0.1,
            flags=0,
        )
        return np.asarray(flow, dtype=np.float32)
