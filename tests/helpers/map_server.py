"""Reads a floor plan as Nav2's map_server does (``map_io.cpp``): yaml keys, thresholds, order."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import yaml


@dataclass(frozen=True)
class ServedMap:
    """What map_server publishes: ``data`` (height, width), rows from the origin upwards."""

    data: npt.NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float]


def served_map(file: Path) -> ServedMap:
    """The map of a yaml file in mode trinary. KeyError: a key that map_server requires is missing.

    It looks for the image beside the yaml file, and has no special grey level for unknown.
    """
    keys = yaml.safe_load(file.read_text())
    assert keys.get("mode", "trinary") == "trinary"
    x, y, yaw = (float(value) for value in keys["origin"])
    pixels = cv2.imread(str(file.parent / keys["image"]), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    assert pixels.ndim == 2  # no alpha, which it would average in
    assert pixels.dtype == np.uint8
    shade = pixels / 255.0
    occupancy = shade if int(keys["negate"]) else 1.0 - shade
    states = np.full(pixels.shape, -1, np.int8)
    states[occupancy < keys["free_thresh"]] = 0
    states[occupancy > keys["occupied_thresh"]] = 100
    data = np.empty(pixels.size, np.int8)
    height, width = pixels.shape
    for row in range(height):
        begin = width * (height - row - 1)
        data[begin : begin + width] = states[row]
    return ServedMap(data.reshape(height, width), float(keys["resolution"]), (x, y, yaw))
