"""The motion towards a plane across the optical axis, whatever the heading."""

from __future__ import annotations

import math

import numpy as np

from navfw.camera_geometry.rotations import rotate_points, rotation_matrix, rotation_vector
from navfw.egomotion.flow_egomotion import (
    MIN_VECTORS,
    Egomotion,
    EgomotionPrior,
    MotionKind,
    PointMotion,
    without_direction,
)
from navfw.numerics import Array
from navfw.numerics.linear_systems import solve
from navfw.numerics.products import product

_PLANE_STEPS = 6  # chosen
_PLANE_ERROR, _PLANE_SHARE, _PLANE_INLIERS = 0.3, 0.1, 0.85  # chosen
"""Error [px], and share of the expansion, up to which a point belongs to a plane across the axis;
least share of such points."""

_MAX_SLANT = 0.35  # chosen
"""Slant [rad] that an unexpected turn may stand for: turn over expansion."""

_MIN_EXPANSION = 0.02  # chosen
"""Smallest relative growth of the image of a plane that is approached."""


def towards_plane(motion: PointMotion, focal: float, prior: EgomotionPrior) -> Egomotion | None:
    """Estimate the motion towards a plane across the optical axis; None if points do not fit it.

    Such a plane expands alike everywhere, regardless of turn and heading, which it hardly
    distinguishes: a point ``x`` comes from ``x - (q_z x - f q_xy)``, ``q`` being the displacement
    in units of the distance to the plane in the past image. The heading stays unknown. To second
    order a slanted plane looks like one across and a turn, so no turn that was not expected is
    believed.
    """
    if int(motion.used.sum()) < MIN_VECTORS:
        return None
    points, rotation, step = motion.points, prior.rotation, 1e-4
    weight, state = np.where(motion.used, 1.0, 0.0), np.zeros(6)
    design, left = np.zeros((len(points), 2, 6)), np.zeros_like(points)
    design[:, 0, 3] = design[:, 1, 4] = -focal
    design[:, :, 5] = points
    for _ in range(_PLANE_STEPS):
        past = rotate_points(motion.past, rotation, focal)
        for axis in range(3):
            turned = rotate_points(past, rotation_matrix(step * np.eye(3)[axis]), focal)
            design[:, :, axis] = (turned - past) / step
        flow = points - past
        good = weight * np.isfinite(flow).all(axis=1) / motion.sigma**2
        rows, known = np.nan_to_num(design), np.nan_to_num(flow)
        matrix: Array = np.einsum("n,nik,nil->kl", good, rows, rows)
        matrix[:3, :3] += prior.information
        gap = rotation_vector(product(prior.rotation, rotation.T))
        right = np.einsum("n,nik,ni->k", good, rows, known)
        right[:3] += product(prior.information, gap)
        state = solve(matrix + 1e-9 * np.eye(6), right)
        rotation = product(rotation_matrix(state[:3]), rotation)
        left = points - rotate_points(motion.past, rotation, focal)
        left -= state[5] * points - focal * state[3:5]
        weight = np.where(motion.used, 1.0 / (1.0 + (np.hypot(*left.T) / _PLANE_ERROR) ** 2), 0.0)
    off = np.hypot(*left.T)[motion.used]
    allowed = _PLANE_ERROR + _PLANE_SHARE * abs(state[5]) * np.hypot(*points[motion.used].T)
    if state[5] < _MIN_EXPANSION or float((off < allowed).mean()) < _PLANE_INLIERS:
        return None
    turned = rotation_vector(product(rotation, prior.rotation.T))
    if math.hypot(turned[0], turned[1]) > _MAX_SLANT * state[5]:
        return None
    return without_direction(MotionKind.FORWARD, prior, rotation, np.array([*state[3:5], state[5]]))
