"""State of the stack at its last step, for displays, records and the runner."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from navfw.safety import PersistentFailure
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    LandmarkDetection,
    MovingObject,
    Odometry,
    Percept,
    Proposal,
    Sight,
    Stixels,
    Waypoint,
)


@dataclass(frozen=True, slots=True)
class StackState:
    """State and decision of the stack at its last step; read only, for displays and records.

    ``flows`` are the newest derotated flow fields; ``stuck`` is why the stack gave up, ``veto`` why
    the safety monitor stops the robot, ``fault`` which sensor has failed for good, or None.
    ``unsure`` is whether the robot is at its goal by an estimate that is too uncertain to say so.
    ``sight`` is how well the camera shows the path ahead. ``landmark_detections`` are those of the
    last frame, known to the map or not; ``detection_counts`` counts all so far, by identity.
    """

    time: float
    odometry: Odometry | None = None
    belief: Belief | None = None
    flows: tuple[FlowField, ...] = ()
    percept: Percept | None = None
    moving_objects: tuple[MovingObject, ...] = ()
    stixels: Stixels | None = None
    waypoint: Waypoint | None = None
    path: tuple[Waypoint, ...] = ()
    proposals: Mapping[str, Proposal] | None = None
    command: Command | None = None
    finished: bool = False
    stuck: str | None = None
    veto: str = ""
    unsure: bool = False
    sight: Sight = Sight.ENOUGH
    fault: PersistentFailure | None = None
    faults: tuple[str, ...] = ()
    landmark_detections: tuple[LandmarkDetection, ...] = ()
    detection_counts: Mapping[str, int] = field(default_factory=dict)
