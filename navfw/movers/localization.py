"""What moves by itself: vectors that nothing at rest can have, where they stand and where they go.

Vectors that contradict a world at rest (``navfw.movers.motion_segmentation``) and lie together are one
mover. Its depth cannot be triangulated; where its lowest part meets the floor can be seen: a ray
that falls by ``g`` per metre of depth (``navfw.offis.floor``) meets the floor ``h / g`` away. With
its distance known, its vectors give its velocity.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from navfw.movers.motion_segmentation import segment_motion
from navfw.offis.floor import fall_per_depth
from navfw.robot import CameraModel
from navfw.signals import Array, FlowField, Mask, MovingObject

__all__ = ["locate_moving_objects"]

LEAST_CELLS = 6
"""Fewer cells together than these are mismatches."""
NEAREST_FALL = 0.10
"""Fall per metre of a ray that tells where a thing stands; flatter ones end too far away."""
BORDER = 9.0
"""Cells nearer to the lower border than this show no feet [px]: flow is not known there."""
BELOW = 0.8
"""What reaches below the image stands nearer than the nearest floor in it, by about this factor."""
SPEEDS = 0.08, 1.5
"""What seems slower [m/s] stands and is the ego map's; what seems faster is a mismatch."""
OVERLAP = 4.0
"""Number of neighbouring cells that share one error."""
FLOW_ERROR = 0.5
"""Error of the vectors on a mover's body, which is no plane [px]."""


def locate_moving_objects(flow: FlowField, camera: CameraModel) -> tuple[MovingObject, ...]:
    """Regions of ``flow`` (derotated, dense) that contradict a world at rest; left to right.

    Raises ValueError when ``flow`` still contains rotation.
    """
    if not flow.derotated:
        raise ValueError("movers need derotated flow (navfw.flow.derotation.derotate)")
    if flow.motion.dt <= 0.0:
        return ()
    fall = fall_per_depth(flow.points, camera)
    odd = segment_motion(flow, fall, camera)
    if np.count_nonzero(odd) < LEAST_CELLS:
        return ()
    count, labels = cv2.connectedComponents(odd.view(np.uint8), connectivity=8)
    sizes = np.bincount(labels.ravel(), minlength=count)
    movers = []
    for label in range(1, count):
        if sizes[label] >= LEAST_CELLS:
            mover = _mover(flow, fall, labels == label, camera)
            if mover is not None and SPEEDS[0] <= math.hypot(*mover.velocity()) <= SPEEDS[1]:
                movers.append(mover)
    return tuple(sorted(movers, key=lambda mover: -mover.bearing))


def _mover(flow: FlowField, fall: Array, cells: Mask, camera: CameraModel) -> MovingObject | None:
    """The mover in these ``cells``; None if it may be far."""
    points = flow.points[cells]
    half_cell = 0.5 * abs(flow.points[0, 1, 0] - flow.points[0, 0, 0])
    # the lowest cells hold the feet, one or two strays set aside; their lower border is the floor
    lowest = _quantile(fall[cells], 0.95) + half_cell / camera.focal
    if lowest < NEAREST_FALL:
        return None
    depth = camera.mount_height / lowest
    if fall[cells].max() >= fall.max() - BORDER / camera.focal:
        depth *= BELOW  # its feet are below the image
    left, right = points[:, 0].min() - half_cell, points[:, 0].max() + half_cell
    bearings = math.atan2(-left, camera.focal), math.atan2(-right, camera.focal)
    off_axis, width = 0.5 * sum(bearings), 0.5 * (bearings[0] - bearings[1])
    evidence = _velocity(points, flow.vectors[cells], depth, flow, camera)
    bearing = camera.bearing + off_axis
    return MovingObject(flow.time, bearing, width, depth / math.cos(off_axis), *evidence)


def _quantile(values: Array, share: float) -> float:
    """What ``share`` of ``values`` (n,) do not exceed: ``np.quantile`` at a tenth of its cost."""
    ordered = np.sort(values)
    place = share * (ordered.size - 1)
    low = int(place)
    below, above = float(ordered[low]), float(ordered[min(low + 1, ordered.size - 1)])
    part = place - low
    if part >= 0.5:
        return above - (above - below) * (1.0 - part)
    return below + (above - below) * part


def _velocity(
    points: Array, vectors: Array, depth: float, flow: FlowField, camera: CameraModel
) -> tuple[Array, Array]:
    """What these ``vectors`` of a thing at ``depth`` [m] say of its velocity: see ``MovingObject``.

    They show the camera's displacement less the thing's own: linear in two unknowns.
    """
    motion, f = flow.motion, camera.focal
    ahead, left = camera.base_from_camera[0], camera.base_from_camera[1]
    depth_then = depth + motion.translation[2]
    # what a thing's own velocity takes off its vectors, for each unit of it
    columns = [(points * axis[2] - f * axis[:2]).ravel() for axis in (ahead, left)]
    design = np.stack(columns, axis=1) * (motion.dt / depth_then)
    s = motion.translation
    at_rest = (points * s[2] - f * s[:2]) / depth_then
    weight = 1.0 / (OVERLAP * FLOW_ERROR**2)
    return weight * design.T @ design, weight * design.T @ (at_rest - vectors).ravel()
