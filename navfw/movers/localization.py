"""Where moving objects are: foot point on the floor, and velocity from their flow.

Connected cells that the motion segmentation (``navfw.movers.motion_segmentation``) marks are one
object. Its depth cannot be triangulated, but its foot point is on the floor: a ray that falls by
``g`` per metre of depth (``CameraModel.fall_per_depth``) meets the floor at depth ``h / g``. With
the distance known, the vectors give the velocity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from navfw.movers.motion_segmentation import crossing_cells, segment_motion
from navfw.numerics import Array, Mask
from navfw.numerics.linear_systems import solve
from navfw.numerics.products import product
from navfw.robot import CameraModel
from navfw.signals import FlowField, MovingObject

_MIN_CELLS = 6  # chosen
"""Least number of connected cells of one object; fewer are mismatches."""
_FLAT, _FLAT_GATE = 3, 60.0  # chosen
"""Height of an object [cells] below which its vectors must be this far from rest, as a sum of
squares [sigma^2]: mismatches along edges on the floor are flat."""
_FITTED = 0.75  # chosen
"""Share of the cells, those that agree best, which give the velocity: at outlines
vectors are mixed with those of the background."""
_MAX_UNEXPLAINED, _FIT_ERROR = 0.03, 0.4  # chosen
"""Largest share of these cells' squares against rest that one velocity leaves, and the error [px]
of a vector up to which it may always leave them: mismatches do not agree with each other."""
_MIN_FALL = 0.10  # chosen
"""Least fall per metre of depth of the ray to a foot point; flatter rays give no usable
distance."""
_SIDEWAYS, _WINDOWS_UNEXPLAINED = 0.1, 0.3  # chosen
"""Least sideways speed of what crosses [m/s], and _MAX_UNEXPLAINED of large windows' flow."""
_BORDER = 9.0  # chosen
"""Distance of cells from the lower image border [px] below which the foot point may be out of view:
flow is not computed there."""
_BELOW_IMAGE = 0.8  # chosen
"""Factor on the distance of an object whose foot point is below the image: it stands nearer than
the nearest floor in view."""
_SPEEDS = 0.15, 1.5  # chosen
"""Least and largest speed of a moving object [m/s]: slower ones are noise, or left to the occupancy
grid, faster ones are mismatches."""
_SHARED_ERRORS = 4.0  # chosen
"""Number of neighbouring cells that share one error."""
_FLOW_ERROR = 0.5  # chosen
"""Error of the vectors on an object's body, which is no plane [px]."""
_WEIGHT = 1.0 / (_SHARED_ERRORS * _FLOW_ERROR**2)  # derived
"""Information of one vector [px^-2]."""


def locate_moving_objects(
    flow: FlowField, camera: CameraModel, whole: FlowField | None = None
) -> tuple[MovingObject, ...]:
    """Detect the moving objects in ``flow`` (derotated, dense); return them from left to right.

    So is what crosses in the flow of the ``whole`` image. Raises ValueError if ``flow`` is not
    marked as derotated.
    """
    if not flow.derotated:
        raise ValueError("moving objects need derotated flow (navfw.camera_geometry.rotations)")
    if flow.motion.dt <= 0.0:
        return ()
    fall = camera.fall_per_depth(flow.points)
    moving, foot = segment_motion(flow, fall, camera)
    count, labels = cv2.connectedComponents(moving.view(np.uint8), connectivity=8)
    sizes = np.bincount(labels.ravel(), minlength=count)
    objects: list[MovingObject] = []
    half_cell = 0.5 * abs(flow.points[0, 1, 0] - flow.points[0, 0, 0]) / camera.focal
    for label in np.flatnonzero(sizes[1:] >= _MIN_CELLS) + 1:
        cells = labels == label
        # the foot point is at the lower border of the lowest cells, but for one in twenty
        falls = np.sort(fall[cells])
        lowest = falls[int(0.95 * (falls.size - 1))] + half_cell
        if falls[-1] >= fall.max() - _BORDER / camera.focal:
            lowest /= _BELOW_IMAGE  # the foot point is below the image
        detection = _locate(flow, cells, lowest, camera, _MAX_UNEXPLAINED)
        if detection and _SPEEDS[0] <= math.hypot(*detection.velocity()) <= _SPEEDS[1]:
            objects.append(detection)
    if whole is not None:
        nearest = np.abs(flow.points[0, :, 0, None] - whole.points[0, :, 0]).argmin(axis=1)
        for cells, inside in crossing_cells(whole, camera):
            ends = foot[inside[nearest] & (foot > 0.0)] * camera.mount_height
            lowest = float(np.median(ends)) - half_cell if ends.size else 0.0
            body = _locate(whole, cells, lowest, camera, _WINDOWS_UNEXPLAINED)
            if body and abs(body.velocity(_SPEEDS[1])[1]) > _SIDEWAYS:
                apart = (abs(body.bearing - o.bearing) > body.width + o.width for o in objects)
                objects += [body] if all(apart) else []
    return tuple(sorted(objects, key=lambda detection: -detection.bearing))


def _locate(
    flow: FlowField, cells: Mask, lowest: float, camera: CameraModel, unexplained: float
) -> MovingObject | None:
    """Locate the object in ``cells``; None if it is too far away, or not one moving body.

    Rays to its foot point fall by ``lowest`` per metre; ``unexplained`` is as _MAX_UNEXPLAINED.
    """
    if lowest < _MIN_FALL:
        return None
    depth, points = camera.mount_height / lowest, flow.points[cells]
    half_cell = 0.5 * abs(flow.points[0, 1, 0] - flow.points[0, 0, 0])
    left, right = points[:, 0].min() - half_cell, points[:, 0].max() + half_cell
    bearings = math.atan2(-left, camera.focal), math.atan2(-right, camera.focal)
    off_axis, width = 0.5 * sum(bearings), 0.5 * (bearings[0] - bearings[1])
    information, evidence, at_rest, least = _velocity(
        points, flow.vectors[cells], depth, flow, camera
    )
    if at_rest < _FLAT_GATE and np.count_nonzero(cells.any(axis=1)) < _FLAT:
        return None
    bearing, distance = camera.bearing + off_axis, depth / math.cos(off_axis)
    detection = MovingObject(flow.time, bearing, width, distance, information, evidence)
    velocity = np.array(detection.velocity(_SPEEDS[1]))
    explained = product(2.0 * evidence - product(information, velocity), velocity)
    return detection if at_rest - explained <= max(unexplained * at_rest, least) else None


def _velocity(
    points: Array, vectors: Array, depth: float, flow: FlowField, camera: CameraModel
) -> tuple[Array, Array, float, float]:
    """Information and evidence of the velocity of an object at ``depth`` [m]: see ``MovingObject``.

    ``vectors`` show the camera's displacement minus the object's: linear in two unknowns. The cells
    that one velocity of all fits worst are left out. The last values are the sum of squares
    [sigma^2] of the others' residuals if the object is at rest, and that which their errors leave.
    """
    motion, f = flow.motion, camera.focal
    ahead, left = camera.base_from_camera[0], camera.base_from_camera[1]
    depth_then = depth + motion.translation[2]
    # change of the vectors per unit of the object's velocity
    columns = [points * axis[2] - f * axis[:2] for axis in (ahead, left)]
    design = np.stack(columns, axis=2) * (motion.dt / depth_then)
    s = motion.translation
    residual = (points * s[2] - f * s[:2]) / depth_then - vectors
    information, evidence, _ = _evidence(design, residual)
    velocity = solve(information + np.eye(2) / _SPEEDS[1] ** 2, evidence)
    squares = np.sum((residual - product(design, velocity)) ** 2, axis=1)
    fitted = np.argsort(squares, kind="stable")[: round(_FITTED * len(points))]
    return *_evidence(design[fitted], residual[fitted]), fitted.size * _WEIGHT * _FIT_ERROR**2


def _evidence(design: Array, residual: Array) -> tuple[Array, Array, float]:
    """Information, evidence and sum of squares of ``residual`` (n, 2), by ``design`` (n, 2, 2)."""
    rows, values = design.reshape(-1, 2), residual.ravel()
    weighted = _WEIGHT * rows.T
    squares = _WEIGHT * float(product(values, values))
    return product(weighted, rows), product(weighted, values), squares


BORDER_ANGLE = math.radians(7.0)  # chosen
"""Angle [rad] from an image's border within which flow is not computed: a detection that ends there
may be cut off."""
_MAX_RATIO = 2.0  # chosen
"""Largest ratio of the distances of two parts of one object."""


def merge_views(
    views: Sequence[Sequence[MovingObject]], cameras: Sequence[CameraModel]
) -> tuple[MovingObject, ...]:
    """Merge the detections in all views into one tuple, from left to right.

    ``views`` has the detections of each of ``cameras``, which stand at one place. Two that end at
    the border between adjacent views, at similar distances, become one.
    """
    bearings = [camera.bearing for camera in cameras]
    order = sorted(range(len(cameras)), key=lambda k: -bearings[k])
    merged: list[MovingObject] = []
    border = math.inf
    for k in order:
        axis, half = bearings[k], 0.5 * cameras[k].hfov
        fresh = sorted(views[k], key=lambda detection: -detection.bearing)
        if merged and fresh and border <= axis + half:
            left, right = merged[-1], fresh[0]
            touching = (
                _right_edge(left) < border + BORDER_ANGLE
                and _left_edge(right) > axis + half - BORDER_ANGLE
            )
            if touching and max(left.distance, right.distance) < _MAX_RATIO * min(
                left.distance, right.distance
            ):
                merged[-1:], fresh = [_merge(left, right)], fresh[1:]
        merged += fresh
        border = axis - half
    return tuple(merged)


def _merge(left: MovingObject, right: MovingObject) -> MovingObject:
    """Join two adjacent parts of an object; its distance is their mean, weighted by width."""
    edges = _left_edge(left), min(_right_edge(left), _right_edge(right))
    share = left.width / max(left.width + right.width, 1e-9)
    return MovingObject(
        left.time,
        0.5 * sum(edges),
        0.5 * (edges[0] - edges[1]),
        share * left.distance + (1.0 - share) * right.distance,
        left.information + right.information,
        left.evidence + right.evidence,
    )


def _left_edge(detection: MovingObject) -> float:
    return detection.bearing + detection.width


def _right_edge(detection: MovingObject) -> float:
    return detection.bearing - detection.width
