"""Errors of the nearness that is inferred on recorded sequences, by their depth images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from navfw.bench import hololens_recording, tum_recording
from navfw.bench.tum_recording import TumRecording
from navfw.config.image_file import read_image
from navfw.perceive.pair_result import PairResult
from navfw.perceive.working_size import WorkingSize
from navfw.signals import Array, Label

TRUSTED = 0.15
"""Largest standard deviation of a trusted cell, relative to its nearness: the median of a normal
error is then 10 %."""

MIN_CELLS = 8
"""Least number of trusted cells of a pair for its scale."""


@dataclass(frozen=True, slots=True)
class DepthFile:
    """A depth image of the size of its colour image, with ``unit`` values for a metre."""

    path: Path
    unit: float

    def read(self) -> Array:
        """Depth (height, width) [m], 0 where it is unknown.

        Raises:
            InputError: the file cannot be read.

        """
        return np.asarray(read_image(self.path, cv2.IMREAD_UNCHANGED), np.float64) / self.unit


@dataclass(frozen=True, slots=True)
class NearnessErrors:
    """Of the cells with a truth: their ``number``, and the relative errors of the trusted ones.

    ``by_way`` (n,) are the errors if the camera's way between the images is known; ``up_to_scale``
    (n,) those after one common factor for the cells of a pair, since images alone have no scale.
    """

    number: int
    by_way: Array
    up_to_scale: Array


def depth_files(data: Path, folder: str) -> Mapping[str, DepthFile]:
    """Depth images of the colour images in ``folder`` by file name; may be empty.

    Raises:
        ConfigError: a list of images cannot be read.

    """
    root = data / folder.split("/", maxsplit=1)[0]
    if folder.startswith("hololens_office"):
        unit = hololens_recording.DEPTH_UNIT
        return {path.name: DepthFile(path, unit) for path in (root / "depth").glob("*.png")}
    if folder.startswith("tum_fr1"):
        unit = tum_recording.DEPTH_UNIT
        images = TumRecording(root).images
        return {image.colour.name: DepthFile(image.depth, unit) for image in images}
    return {}


def nearness_errors(
    result: PairResult, size: WorkingSize, depth: Array, way: float
) -> NearnessErrors:
    """Errors of the cells of a pair, by ``depth`` (height, width) [m] of its second image.

    ``way`` [m] is the true length of the camera's way between the images.
    """
    percept = result.percept
    x, y = np.floor(size.to_image(percept.points)).astype(np.int64).transpose(2, 0, 1)
    true = depth[np.clip(y, 0, depth.shape[0] - 1), np.clip(x, 0, depth.shape[1] - 1)]
    known = true > 0.0
    trusted = known & (percept.label != Label.UNKNOWN) & result.known
    trusted &= percept.sigma <= TRUSTED * percept.nearness
    number = int(known.sum())
    if int(trusted.sum()) < MIN_CELLS:
        return NearnessErrors(number, np.empty(0), np.empty(0))
    # both in ways of the camera: the percept's metres are nominal
    ratio = percept.nearness[trusted] * result.flow.motion.baseline * true[trusted] / way
    common = float(np.median(ratio))
    return NearnessErrors(number, np.abs(ratio - 1.0), np.abs(ratio / common - 1.0))
