"""What stands on the floor, column by column of small cells: thin poles that windows look past.

With the floor at rest in the image (``navfw.flow.floor_aligned``), a column of cells that shows a
standing thing obeys one number: below its foot the flow is the floor's, above it is that of one
distance, all the way up ("stixels": Badino, Franke and Pfeiffer 2009, there from stereo). So a
whole column is held against each distance. That finds poles a few cells wide, which a window of 24
px mixes with what is behind them, and finds them straight ahead, where single vectors are short: a
pole ahead still outruns the floor that it hides.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from navfw.offis.floor import fall_per_depth
from navfw.robot import CameraModel
from navfw.signals import Array, FlowField, Stixels

__all__ = ["STEEPEST", "find_stixels"]

STEEPEST = 0.15
"""Pitch [rad] of the camera beyond which upright things lean in the image, across columns."""
NEARNESS = np.geomspace(0.3, 5.0, 57)
"""The nearness [1/m, ahead of the camera] of all the places that a column is held against."""
FARTHER = 0.7
"""A thing has to explain its column better than any that is at most so near, in proportion."""
OUTLIER = 9.0
"""A cell counts at most so much: three standard deviations, squared."""
UNEVEN = 0.1
"""Error of a cell [px] beside its flow's own: floor is not quite even, cells mix two depths."""
LEAST_CELLS = 5
"""A column of fewer cells says nothing."""
EVIDENCE = 6.0, 14.0
"""Gain in squared standard deviations that says nothing yet, and that says all."""
ALIKE = 0.2
"""Columns whose nearness differs by more than this, in proportion, do not confirm each other."""
ERROR = 0.08
"""Error of nearness in proportion, held against the floor plan in rendered drives."""
SHORTEST = 0.03
"""Baseline [m] below which flow tells no distances."""


def find_stixels(flow: FlowField, camera: CameraModel) -> Stixels | None:
    """What stands in each column of ``flow`` (derotated, dense, floor below); None if unknown.

    Raises ValueError when ``flow`` still contains rotation.
    """
    if not flow.derotated:
        raise ValueError("standing things need derotated flow (navfw.flow.derotation.derotate)")
    motion = flow.motion
    if motion.baseline < SHORTEST or abs(camera.pitch) > STEEPEST:
        return None
    fall = fall_per_depth(flow.points, camera)
    ahead = math.cos(camera.pitch) - flow.points[..., 1] / camera.focal * math.sin(camera.pitch)
    nearness, gain = _columns(
        np.ascontiguousarray(flow.points, dtype=np.float64),
        np.ascontiguousarray(flow.vectors, dtype=np.float64),
        np.ascontiguousarray(flow.sigma, dtype=np.float64),
        np.ascontiguousarray(flow.confidence, dtype=np.float64),
        np.maximum(fall, 0.0) / camera.mount_height,
        ahead,
        np.ascontiguousarray(motion.translation, dtype=np.float64),
        camera.focal,
        float(motion.yaw_sigma),
        NEARNESS,
    )
    low, high = EVIDENCE
    confidence = np.clip((gain - low) / (high - low), 0.0, 1.0)
    confidence[~_confirmed(nearness, gain)] = 0.0
    return Stixels(
        time=flow.time,
        slope=-flow.points[0, :, 0] / camera.focal * math.cos(camera.pitch),
        nearness=nearness,
        sigma=np.hypot(ERROR * nearness, motion.translation_sigma / motion.baseline * nearness),
        confidence=confidence,
    )


def _confirmed(nearness: Array, gain: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(n,) which columns have a neighbour that says about the same."""
    alike = np.abs(np.diff(nearness)) < ALIKE * np.minimum(nearness[1:], nearness[:-1])
    alike &= np.minimum(gain[1:], gain[:-1]) > 0.5 * EVIDENCE[0]
    confirmed = np.zeros(nearness.size, np.bool_)
    confirmed[1:] |= alike
    confirmed[:-1] |= alike
    return confirmed


@numba.njit(cache=True)
def _columns(
    points: Array,
    vectors: Array,
    sigma: Array,
    confidence: Array,
    floor: Array,
    ahead: Array,
    translation: Array,
    focal: float,
    yaw_sigma: float,
    places: Array,
) -> tuple[Array, Array]:
    """Nearness (cols,) [1/m] of the place that explains each column best, and what it gains.

    ``floor`` (rows, cols) [1/m] is the nearness of the empty floor, ``ahead`` (rows, cols) what a
    ray advances ahead per metre of depth. The gain is over the best of all places farther away.
    """
    rows, cols = sigma.shape
    tx, ty, tz = translation
    best, gain = np.zeros(cols), np.zeros(cols)
    cost = np.empty(places.size)
    for j in range(cols):
        cost[:] = 0.0
        cells = 0
        for i in range(rows):
            if not confidence[i, j] > 0.0:
                continue
            x, y = points[i, j, 0], points[i, j, 1]
            away_x, away_y = x * tz - focal * tx, y * tz - focal * ty
            lever = math.hypot(away_x, away_y)
            if lever < 1e-9:
                continue
            cells += 1
            away_x, away_y = away_x / lever, away_y / lever
            along = vectors[i, j, 0] * away_x + vectors[i, j, 1] * away_y
            turning = yaw_sigma * ((focal + x * x / focal) * away_x + x * y / focal * away_y)
            variance = sigma[i, j] ** 2 + turning**2 + UNEVEN**2
            for k in range(places.size):
                q = max(places[k] * ahead[i, j], floor[i, j])
                off = along - lever * q / (1.0 + tz * q)
                cost[k] += min(off * off / variance, OUTLIER)
        if cells < LEAST_CELLS:
            continue
        place = int(np.argmin(cost))
        best[j] = places[place]
        farther = math.inf
        for k in range(place):
            if places[k] < FARTHER * places[place]:
                farther = min(farther, cost[k])
        if farther < math.inf:
            gain[j] = farther - cost[place]
    return best, gain
