"""Obstacles too near to be matched, inferred from blind columns at the border of the image.

An obstacle close beside the robot moves through the image faster than the search range of the flow
processor, so the nearest obstacle of all may yield no flow. If no vector near the horizon could be
matched in columns at the border, although they were in the past camera's field of view, a rule base
infers the degree to which a near obstacle is there: unknown is never free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfw.offis.fuzzy_systems import FuzzyEvaluation, infer_rows, load_system
from navfw.offis.grid_geometry import GridGeometry
from navfw.offis.percept_kernels import blind_border
from navfw.signals import Array, FlowField

_BEYOND = 1.4
"""Nearness of such an obstacle relative to the least nearness outside the search range; a typical
value from measurements."""

SLACK = 1.5
"""Distance [px] beyond the outermost column up to which the past image still shows enough of it."""


@dataclass(frozen=True, slots=True)
class BlindBorders:
    """``hidden`` (2, columns): nearness [1/m] of the inferred obstacle and its degree in [0, 1]."""

    hidden: Array
    evaluation: FuzzyEvaluation


def find_blind_borders(
    flow: FlowField, geometry: GridGeometry, focal: float, longest: float
) -> BlindBorders:
    """Infer near obstacles at both borders of ``flow``.

    ``longest`` [px] is the longest vector that the flow processor can measure.
    """
    motion = flow.motion
    found = blind_border(
        flow.points.reshape(-1, 2),
        geometry.fall,
        geometry.column,
        flow.vectors.reshape(-1, 2),
        flow.confidence.reshape(-1),
        motion.rotation,
        focal,
        float(geometry.off_axis[0].max()) + SLACK,
        float(motion.translation[2]),
        longest,
    )
    evaluation = infer_rows(load_system("border"), np.ascontiguousarray(found[:, :2].T))
    degree = evaluation.degree("border", "near") * (found[:, 1] >= 0.0)
    hidden = np.zeros((2, flow.shape[1]))
    last_left, first_right = int(found[0, 3]), int(found[1, 3])
    if degree[0] > 0.0:
        hidden[0, : last_left + 1], hidden[1, : last_left + 1] = _BEYOND * found[0, 2], degree[0]
    if degree[1] > 0.0:
        hidden[0, first_right:], hidden[1, first_right:] = _BEYOND * found[1, 2], degree[1]
    return BlindBorders(hidden, evaluation)
