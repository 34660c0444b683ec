"""True headings of recorded sequences, from the poses of their cameras."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from navfw.bench.hololens_recording import read_poses
from navfw.bench.tum_recording import TumRecording
from navfw.perceive.pair_result import PairResult
from navfw.signals import Array


def camera_poses(data: Path, folder: str) -> Mapping[str, Array]:
    """Poses (4, 4), camera to world, of the images in ``folder`` by file name; may be empty.

    Raises:
        ConfigError: a file of poses cannot be read.

    """
    root = data / folder.split("/", maxsplit=1)[0]
    if folder.startswith("hololens_office"):
        names = sorted(path.name for path in (root / "images").glob("*.png"))
        return dict(zip(names, read_poses(root), strict=False))
    if folder.startswith("tum_fr1"):
        return {
            image.colour.name: np.vstack(
                [np.column_stack([image.axes, image.place]), [0.0, 0.0, 0.0, 1.0]]
            )
            for image in TumRecording(root).images
        }
    return {}


def heading_error(result: PairResult, past: Array, now: Array) -> float:
    """Angle [deg] between the heading of a pair and the true one, from the poses (4, 4)."""
    shift = now[:3, :3].T @ (now[:3, 3] - past[:3, 3])
    length = float(np.linalg.norm(shift))
    cosine = float(result.egomotion.direction @ shift) / max(length, 1e-12)
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))


def camera_way(past: Array, now: Array) -> float:
    """Distance [m] between the places of two poses (4, 4)."""
    return float(np.linalg.norm(now[:3, 3] - past[:3, 3]))
