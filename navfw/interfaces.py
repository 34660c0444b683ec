"""The nine kinds of plugin: each a small base class with the one method that its room asks for.

A plugin is constructed with the robot's model and its validated parameters, is told ``reset()`` at
the start of every run, and keeps no state outside itself. Which plugin of each kind runs, with
which parameters, is said in a stack file (``navfw/stacks``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import BaseModel, ConfigDict

from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    Frame,
    FramePair,
    LandmarkDetection,
    Odometry,
    PassageQuery,
    PassageReport,
    Percept,
    Pose,
    Proposal,
    Twist,
    Waypoint,
)

if TYPE_CHECKING:
    from navfw.mofis.context import Context
    from navfw.topomap import TopoMap

__all__ = [
    "KINDS",
    "Behavior",
    "Composite",
    "Controller",
    "FeatureRecognizer",
    "FlowProcessor",
    "Fusion",
    "Localizer",
    "Params",
    "Perception",
    "Planner",
    "Plugin",
]


class Params(BaseModel):
    """The base of every plugin's parameters: unknown keys are errors, values are frozen.

    One declaration gives validation, ``navfw plugins`` listings, YAML and ``--set`` overrides; give
    each field a ``Field(description=...)`` with its unit, and bounds.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Plugin(ABC):
    """What all kinds share.

    ``name`` is what stack files call it; ``Params`` declares its parameters. ``oracle`` marks a
    plugin that needs truth no robot has: a stack file that names it must say ``oracle: true``.
    """

    kind: ClassVar[str]
    name: ClassVar[str]
    oracle: ClassVar[bool] = False

    class Params(Params):
        """No parameters, unless a plugin says otherwise."""

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        self.robot = robot
        self.params = self.Params() if params is None else params

    def reset(self) -> None:  # noqa: B027 - a plugin without state need not override it
        """Forget the last run; called once before each run."""


class FlowProcessor(Plugin):
    """Optical Flow Processor (paper sec 3): two frames in, a sparse flow field out."""

    kind = "flow"

    @abstractmethod
    def compute(self, pair: FramePair) -> FlowField:
        """Flow of ``pair.now`` against ``pair.past``, not derotated, on the plugin's grid.

        ``pair.motion.rotation`` may serve to predict where to search; the result must contain the
        whole motion all the same.
        """


class Perception(Plugin):
    """OFFIS (paper sec 4, 5): a derotated flow field in, fuzzy and metric knowledge out."""

    kind = "perception"

    @abstractmethod
    def perceive(self, flow: FlowField, twist: Twist) -> Percept:
        """Interpret ``flow`` (derotated); ``twist`` is the measured egomotion at its time."""


class FeatureRecognizer(Plugin):
    """Feature Recognition Processor (paper sec 2): landmarks from single images.

    One that sets ``landmark_frames`` is given the larger frames that the camera takes for landmarks
    (``RobotModel.landmark_view``), at their lower rate, and no others; only for it are they taken.
    """

    kind = "features"
    landmark_frames: ClassVar[bool] = False

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map whose landmarks are to be recognised; called before each run."""

    @abstractmethod
    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """All landmarks detected in ``frame``, in the map or not."""


class Localizer(Plugin):
    """Estimates the robot's pose in the map, and the probability of each place."""

    kind = "localizer"

    @abstractmethod
    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame), or anywhere when None; ``odometry`` is the present one."""

    @abstractmethod
    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """The belief after the newest odometry and, where there are any, percept and detections."""


class Planner(Plugin):
    """PAPFIS (paper sec 2): a sequence of waypoints through the topological map."""

    kind = "planner"

    @abstractmethod
    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start a mission: visit ``goals`` in order. Plans at the first ``update``."""

    @abstractmethod
    def update(self, belief: Belief) -> Waypoint | None:
        """The waypoint to drive to now, or None when the last goal has been reached."""

    @property
    @abstractmethod
    def path(self) -> Sequence[Waypoint]:
        """The waypoints still ahead, nearest first (for displays and records)."""

    # For planners that replan on passage reports; others need not override these.

    @property
    def queries(self) -> Sequence[PassageQuery]:
        """The legs ahead, in order, whose passage status ``observe`` is to report."""
        return ()

    def observe(self, report: PassageReport) -> None:
        """Take in the status of the ``queries``; called before ``update``."""

    @property
    def no_route_reason(self) -> str | None:
        """Why no route leads to the goal at present; None while there is one."""
        return None


class Behavior(Plugin):
    """A primitive behaviour of MOFIS (paper Fig. 1): from the context, a proposal.

    One that sets ``handles_moving_obstacles`` judges commands by where they meet movers
    (``context.encounters``). While one is there, the others need not: ``context.arcs`` and
    ``context.ranges`` then know of what stands alone. Without one, movers are things like others.
    """

    kind = "behavior"
    handles_moving_obstacles: bool = False

    @abstractmethod
    def propose(self, context: Context) -> Proposal:
        """How applicable this behaviour is now, what it desires, and what it forbids."""


class Composite(Plugin):
    """A composite behaviour of MOFIS (paper Fig. 1): what its primitives have to say just now."""

    kind = "composite"

    @abstractmethod
    def weigh(self, context: Context) -> Mapping[str, float]:
        """The degree in [0, 1] to which each primitive is applicable; 1 for those not named.

        It multiplies the applicability that the primitive finds for itself.
        """

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """The rules that fired for the last ``weigh``, strongest first; none unless overridden."""
        return ()


class Fusion(Plugin):
    """Command fusion (paper sec 2, METHOD 3): all proposals in, one command out."""

    kind = "fusion"

    @abstractmethod
    def fuse(self, context: Context, proposals: Mapping[str, Proposal]) -> Command:
        """The command that serves the proposals (by behaviour name) best."""


class Controller(Plugin):
    """LOCOM (paper sec 2): realises the fused command within the limits of the drive."""

    kind = "controller"

    @abstractmethod
    def control(self, command: Command | None, odometry: Odometry, dt: float) -> Twist:
        """The twist to drive for the next ``dt`` [s]; ``command`` None means: stand still."""


KINDS: dict[str, type[Plugin]] = {
    base.kind: base
    for base in (
        Behavior,
        Composite,
        FlowProcessor,
        Perception,
        FeatureRecognizer,
        Localizer,
        Planner,
        Fusion,
        Controller,
    )
}
