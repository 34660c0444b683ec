"""Exact removal of the rotational part of the flow (paper sec 3, METHOD 2.4)."""

from __future__ import annotations

import dataclasses

import numpy as np

from navfw.camera_geometry.turned_points import rotate_points, undo_turn
from navfw.robot import CameraModel
from navfw.signals import Array, FlowField


def rotational_flow(points: Array, rotation: Array, focal: float) -> Array:
    """Flow (..., 2) [px] at current ``points`` of a camera that only rotates by ``rotation``.

    It is independent of depth. The exact form of METHOD 2.3; ``rotation`` maps past to current
    axes, as in CameraMotion.
    """
    return points - rotate_points(points, rotation.T, focal)


def derotate(flow: FlowField, camera: CameraModel) -> FlowField:
    """``flow`` of a camera with the same translation but without rotation.

    The past end of each vector is rotated into the current camera's axes; the result obeys the
    equations of pure translation exactly, for rotations of any size. A field that is already
    derotated is returned unchanged.
    """
    if flow.derotated:
        return flow
    vectors = derotated_vectors(flow, flow.motion.rotation, camera)
    return dataclasses.replace(flow, vectors=vectors, derotated=True)


def derotated_vectors(flow: FlowField, rotation: Array, camera: CameraModel) -> Array:
    """The vectors (rows, cols, 2) [px] of ``derotate`` for a given ``rotation``."""
    if flow.derotated:
        return flow.vectors
    vectors: Array = undo_turn(
        np.ascontiguousarray(flow.points, dtype=np.float64).reshape(-1, 2),
        np.ascontiguousarray(flow.vectors, dtype=np.float64).reshape(-1, 2),
        np.ascontiguousarray(rotation, dtype=np.float64),
        camera.focal,
    )
    return vectors.reshape(flow.vectors.shape)
