"""Leaving out what lies below the horizon, for a robot that cannot tell the floor from things."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from navfw.robot import CameraModel
from navfw.signals import FlowField

__all__ = ["above_horizon"]


def above_horizon(flow: FlowField, camera: CameraModel) -> FlowField:
    """``flow`` without trust in vectors whose rays fall: they may show the floor (METHOD 2.8)."""
    falls = flow.points[..., 1] * math.cos(camera.pitch) + camera.focal * math.sin(camera.pitch)
    return dataclasses.replace(flow, confidence=np.where(falls > 0.0, 0.0, flow.confidence))
