"""The kinds of plugin: one small base class each.

A plugin is constructed with the robot's model and its validated parameters. ``reset()`` is called
at the start of every run; a plugin keeps no state outside itself. Nine kinds are stages of the
stack or parts of MOFIS; a stack file (``navfw/stack/stacks``) names the plugin of each and its
parameters. Three kinds extend worlds and missions: landmark kinds, mission events, families of
generated worlds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from navfw.config.strict_model import StrictModel
from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    Command,
    FlowField,
    Frame,
    FramePair,
    GrownGrid,
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
    import numpy as np

    from navfw.context import Context
    from navfw.topomap import Passage, TopoMap


class Params(StrictModel):
    """Base class of every plugin's parameters: unknown keys are errors, values are frozen.

    One declaration gives validation, listings (``navfw list plugins``), YAML and ``--set``
    overrides; give each field a ``Field(description=...)`` with its unit, and bounds.
    """


class Plugin(ABC):
    """Base class of all kinds of plugin.

    ``name`` is the plugin's name in files; ``Params`` declares its parameters. ``oracle`` marks a
    plugin that needs the simulator's truth: a stack file that names it must set ``oracle: true``.
    """

    kind: ClassVar[str]
    name: ClassVar[str]
    oracle: ClassVar[bool] = False

    class Params(Params):
        """No parameters, unless a plugin declares some."""

    params: Params

    def __init__(self, robot: RobotModel, params: Params | None = None) -> None:
        self.robot = robot
        self.params = self.Params() if params is None else params

    @classmethod  # noqa: B027 - most plugins read none
    def check_files(cls) -> None:
        """Raise InputError if a file that the plugin reads when it is made is missing or wrong."""

    def reset(self) -> None:  # noqa: B027 - a plugin without state need not override it
        """Return to the state at the start of a run; called once before each run."""


class FlowProcessor(Plugin):
    """Optical Flow Processor (paper sec 3): two frames in, a sparse flow field out."""

    kind = "flow"

    @abstractmethod
    def compute(self, pair: FramePair) -> FlowField:
        """Measure the flow from ``pair.past`` to ``pair.now``, not derotated, on the plugin's grid.

        ``pair.motion.rotation`` may serve to predict where to search; the rotational flow must
        remain in the result.
        """


class Perception(Plugin):
    """OFFIS (paper sec 4, 5): a derotated flow field in, a percept out."""

    kind = "perception"

    @abstractmethod
    def perceive(self, flow: FlowField, twist: Twist) -> Percept:
        """Interpret the derotated ``flow``; ``twist`` is the robot's measured twist at its time."""


class FeatureRecognizer(Plugin):
    """Feature Recognition Processor (paper sec 2): landmarks from single images.

    With ``landmark_frames`` it gets only the larger frames of lower rate
    (``RobotModel.landmark_view``), which are taken only if a plugin asks for them.
    """

    kind = "features"
    landmark_frames: ClassVar[bool] = False

    def set_map(self, topo_map: TopoMap) -> None:
        """Set the map with the landmarks to be recognised; called before each run."""

    @abstractmethod
    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """Detect all landmarks in ``frame``, those that are not in the map included."""


class Localizer(Plugin):
    """Estimates the robot's pose in the map, and the probability of each place."""

    kind = "localizer"

    @abstractmethod
    def start(self, topo_map: TopoMap, pose: Pose | None, odometry: Odometry) -> None:
        """Start at ``pose`` (map frame), unknown if None, with the present ``odometry``."""

    @abstractmethod
    def update(
        self, odometry: Odometry, percept: Percept | None, detections: Sequence[LandmarkDetection]
    ) -> Belief:
        """Update the belief with the newest odometry, a percept if there is one, and detections."""


class Planner(Plugin):
    """PAPFIS (paper sec 2): a sequence of waypoints through the topological map."""

    kind = "planner"

    @abstractmethod
    def start(self, topo_map: TopoMap, goals: Sequence[Waypoint]) -> None:
        """Start a mission to visit ``goals`` in order; the first ``update`` plans the route."""

    @abstractmethod
    def update(self, belief: Belief) -> Waypoint | None:
        """Return the waypoint to drive to now, or None once the last goal has been reached."""

    @property
    @abstractmethod
    def path(self) -> Sequence[Waypoint]:
        """Waypoints still ahead, nearest first (for displays and records)."""

    # For planners that replan on passage reports; others need not override these.

    @property
    def queries(self) -> Sequence[PassageQuery]:
        """Legs ahead, in order, whose passage status ``observe`` is to get."""
        return ()

    def observe(self, report: PassageReport) -> None:
        """Process the reported status of the ``queries``; called before ``update``."""

    @property
    def wants_grid(self) -> bool:
        """Whether ``observe_grid`` is to get what was observed so far, twice a second."""
        return False

    def observe_grid(self, grid: GrownGrid) -> None:
        """Process what was observed so far, before ``update``."""

    @property
    def no_route_reason(self) -> str | None:
        """Reason why no route leads to the goal at present; None while there is a route."""
        return None

    @property
    def notes(self) -> str:
        """What was found to differ from the map, for the result."""
        return ""

    @property
    def closed(self) -> Sequence[Passage]:
        """Passages of the map that were found closed, for the list of its changes."""
        return ()

    @property
    def found(self) -> Sequence[tuple[str, Sequence[tuple[float, float]]]]:
        """Names and tracks (x, y) [m] of ways that were driven and that the map has not."""
        return ()

    @property
    def topo_map(self) -> TopoMap | None:
        """The map with the ways that were found; None for that of ``start``."""
        return None

    def explain_choice(self) -> Mapping[str, Any]:
        """Explain where the planner heads for, as plain data; empty if a route says it."""
        return {}


class Behavior(Plugin):
    """A primitive behaviour of MOFIS (paper Fig. 1): from the context, a proposal.

    Set ``handles_moving_obstacles`` if it rates commands by their conflicts with moving obstacles
    (``context.conflicts``). While such a behaviour proposes, ``context.arcs`` and
    ``context.ranges`` cover static obstacles only; without one, moving obstacles count as occupied.
    """

    kind = "behavior"
    handles_moving_obstacles: bool = False

    @abstractmethod
    def propose(self, context: Context) -> Proposal:
        """Return the applicability now, and the desirability and prohibition of every command."""


class Composite(Plugin):
    """A composite behaviour of MOFIS (paper Fig. 1): weights of the primitives."""

    kind = "composite"

    @abstractmethod
    def weigh(self, context: Context) -> Mapping[str, float]:
        """Return the degree in [0, 1] to which each primitive is applicable; 1 for those not named.

        The applicability of the primitive's own proposal is multiplied by it.
        """

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """Return the rules that fired in the last ``weigh``, strongest first; none by default."""
        return ()


class Fusion(Plugin):
    """Command fusion (paper sec 2, METHOD 3): all proposals in, one command out."""

    kind = "fusion"
    needs_proposals: ClassVar[bool] = True
    """If False, no behaviour is asked, and contexts have no local goal."""
    needs_room: ClassVar[bool] = True
    """If False, arcs and ranges are not computed: in contexts all their distances are 0."""

    @abstractmethod
    def fuse(self, context: Context, proposals: Mapping[str, Proposal]) -> Command:
        """Combine ``proposals``, by behaviour name, into one command."""


class Controller(Plugin):
    """LOCOM (paper sec 2): follows the fused command within the limits of the drive."""

    kind = "controller"

    @abstractmethod
    def control(self, command: Command | None, odometry: Odometry, dt: float) -> Twist:
        """Return the twist to drive for the next ``dt`` [s]; without ``command``, one to stop."""


class LandmarkKind(Plugin):
    """A kind of landmark: a flat upright square with a picture, one for each id.

    World and map files name it as a landmark's ``kind``. Recognition is up to a
    ``FeatureRecognizer``, whose detections have the identity ``NAME-ID``.
    """

    kind = "landmark"
    ids: ClassVar[int] = 1_000_000
    default_size: ClassVar[float] = 0.5

    def plate_side(self, size: float) -> float:
        """Return the side [m] of the plate on which a landmark of that ``size`` [m] is shown."""
        return size

    @abstractmethod
    def plate_image(self, number: int) -> Image:
        """Draw the plate of id ``number``, seen frontally: (N, N) uint8 luminance."""


class MissionEvent(Plugin):
    """A mission event composed of shipped ones: ``events: [{at: 3, plugin: {NAME: {...}}}]``.

    The parameters in the mission file are those of ``Params``. The simulator applies the events;
    the stack gets no information about them.
    """

    kind = "event"

    @abstractmethod
    def actions(self, world: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Return actions that begin together, as in mission files: ``{"light": {"share": 0.2}}``.

        ``world`` is the content of the world file.
        """


class WorldFamily(Plugin):
    """A family of generated worlds, for ``navfw world new`` and suites."""

    kind = "family"

    @abstractmethod
    def build(self, rng: np.random.Generator, difficulty: float) -> object:
        """Draw a ``navfw.worldgen.world_draft.WorldDraft``; ``difficulty`` is in [0, 1].

        Raises:
            navfw.worldgen.world_draft.Unsuitable: the draw is not usable; another one is tried.

        """


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
        LandmarkKind,
        MissionEvent,
        WorldFamily,
    )
}
