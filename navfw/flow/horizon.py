"""Removal of flow below the horizon, for stacks that cannot tell the floor from obstacles."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navfw.robot import CameraModel
from navfw.signals import FlowField


def above_horizon(flow: FlowField, camera: CameraModel) -> FlowField:
    """``flow`` with confidence 0 below the horizon, where a ray may meet the floor (METHOD 2.8)."""
    falls = flow.points[..., 1] * math.cos(camera.pitch) + camera.focal * math.sin(camera.pitch)
    return dataclasses.replace(flow, confidence=np.where(falls > 0.0, 0.0, flow.confidence))
