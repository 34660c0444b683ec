"""The result of one pair of images."""

from __future__ import annotations

from dataclasses import dataclass

from navfw.egomotion.flow_egomotion import Egomotion
from navfw.perceive.scale import Scale
from navfw.signals import Array, FlowField, Percept


@dataclass(frozen=True, slots=True)
class PairResult:
    """Everything computed from one pair of images.

    ``flow`` is derotated and refers to the working image. ``focus`` (x, y) is the focus of
    expansion [px from the top left of the original image], None where it is unknown.
    ``rotation_vector`` (3,) [rad] is the camera's rotation about base_link's x, y, z (roll, pitch,
    yaw); ``turn_source`` tells what measured it: "gyro", "poses" or "flow"; ``egomotion`` is the
    estimate before it is refined by the flow on the grid. ``contact`` [s] is the time to
    contact with the surface straight ahead, ``quadrant_contact`` [s] that of the nearest part of
    each quadrant; both are inf where nothing approaches. ``confidence`` is in [0, 1]. If ``known``
    is false, the percept is "unknown" and ``notes`` give the reason.
    """

    number: int
    past: str
    now: str
    time: float
    dt: float
    scale: Scale
    flow: FlowField
    percept: Percept
    rotation_vector: Array
    turn_source: str
    egomotion: Egomotion
    focus: tuple[float, float] | None
    contact: float
    quadrant_contact: dict[str, float]
    confidence: float
    known: bool
    notes: tuple[str, ...]
