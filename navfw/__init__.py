"""navfw: a mobile robot with one camera finds its way by fuzzy behaviours.

``run`` and ``open_session`` drive missions. The other names are those that a behaviour or another
plugin needs, and types of results. Each is imported on first use, so that ``import navfw`` is fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from navfw.lazy_names import first_access

if TYPE_CHECKING:
    from navfw.context import Context
    from navfw.interfaces import (
        Behavior,
        Composite,
        Controller,
        FeatureRecognizer,
        FlowProcessor,
        Fusion,
        Localizer,
        Perception,
        Planner,
    )
    from navfw.missions.outcome import Outcome
    from navfw.missions.pilot import TickView
    from navfw.missions.session import MissionResult, SteppedSession
    from navfw.missions.session_setup import open_session, run
    from navfw.mofis.ruled import RuledBehavior, RuledComposite
    from navfw.mofis.rules import BehaviorRules
    from navfw.robot import CameraModel, RobotModel
    from navfw.signals import (
        Array,
        Command,
        Explain,
        FlowField,
        Label,
        Percept,
        Pose,
        Proposal,
        Twist,
        Waypoint,
    )

__version__ = "0.1.0"

_HOMES = {
    "Array": "navfw.signals",
    "Behavior": "navfw.interfaces",
    "BehaviorRules": "navfw.mofis.rules",
    "CameraModel": "navfw.robot",
    "Command": "navfw.signals",
    "Composite": "navfw.interfaces",
    "Context": "navfw.context",
    "Controller": "navfw.interfaces",
    "Explain": "navfw.signals",
    "FeatureRecognizer": "navfw.interfaces",
    "FlowField": "navfw.signals",
    "FlowProcessor": "navfw.interfaces",
    "Fusion": "navfw.interfaces",
    "Label": "navfw.signals",
    "Localizer": "navfw.interfaces",
    "MissionResult": "navfw.missions.session",
    "Outcome": "navfw.missions.outcome",
    "Percept": "navfw.signals",
    "Perception": "navfw.interfaces",
    "Planner": "navfw.interfaces",
    "Pose": "navfw.signals",
    "Proposal": "navfw.signals",
    "RobotModel": "navfw.robot",
    "RuledBehavior": "navfw.mofis.ruled",
    "RuledComposite": "navfw.mofis.ruled",
    "SteppedSession": "navfw.missions.session",
    "TickView": "navfw.missions.pilot",
    "Twist": "navfw.signals",
    "Waypoint": "navfw.signals",
    "open_session": "navfw.missions.session_setup",
    "run": "navfw.missions.session_setup",
}

__all__ = [
    "Array",
    "Behavior",
    "BehaviorRules",
    "CameraModel",
    "Command",
    "Composite",
    "Context",
    "Controller",
    "Explain",
    "FeatureRecognizer",
    "FlowField",
    "FlowProcessor",
    "Fusion",
    "Label",
    "Localizer",
    "MissionResult",
    "Outcome",
    "Percept",
    "Perception",
    "Planner",
    "Pose",
    "Proposal",
    "RobotModel",
    "RuledBehavior",
    "RuledComposite",
    "SteppedSession",
    "TickView",
    "Twist",
    "Waypoint",
    "__version__",
    "open_session",
    "run",
]


def __getattr__(name: str) -> Any:
    return first_access(__name__, name, _HOMES)


def __dir__() -> list[str]:
    return __all__
