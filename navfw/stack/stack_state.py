"""State of the stack at its last step, for displays, records and the runner; its progress.

A watch says whether the robot makes progress on its route, and why it gives up where it does not.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from navfw import signals
from navfw.mofis.mofis import Mofis
from navfw.safety import PersistentFailure, SafetyVerdict


@dataclass(frozen=True, slots=True)
class StackState:
    """What the stack knew and decided at its last frame; read only, for displays and records.

    ``flows`` are the newest derotated flow fields; ``stuck`` is why the stack gave up, ``veto`` why
    the safety monitor stops the robot, ``fault`` what has failed for too long, ``faults`` are those
    of plugins. ``unsure``: the estimate is at the goal, but too uncertain to count. ``sight`` is
    how well the camera shows the path ahead, ``slower`` the rule or limit that has kept the robot
    below its top speed since the last frame, ``notes`` what the planner found to differ from the
    map. ``landmark_detections`` are the last frame's, in the map or not; ``detection_counts``
    counts all so far, by identity.
    """

    time: float
    odometry: signals.Odometry | None = None
    belief: signals.Belief | None = None
    flows: tuple[signals.FlowField, ...] = ()
    percept: signals.Percept | None = None
    moving_objects: tuple[signals.MovingObject, ...] = ()
    stixels: signals.Stixels | None = None
    waypoint: signals.Waypoint | None = None
    path: tuple[signals.Waypoint, ...] = ()
    proposals: Mapping[str, signals.Proposal] | None = None
    command: signals.Command | None = None
    finished: bool = False
    stuck: str | None = None
    veto: str = ""
    unsure: bool = False
    sight: signals.Sight = signals.Sight.ENOUGH
    slower: str = ""
    notes: str = ""
    fault: PersistentFailure | None = None
    faults: tuple[str, ...] = ()
    landmark_detections: tuple[signals.LandmarkDetection, ...] = ()
    detection_counts: Mapping[str, int] = field(default_factory=dict)


_FULL_SPEED, _RAMP = 0.95, 0.03  # chosen
"""Share of the top speed from which it counts as full; lag [m/s] from which the robot speeds up."""


def why_slower(command: signals.Command | None, verdict: SafetyVerdict, mofis: Mofis) -> str:
    """Return what keeps a robot that drives as in ``verdict`` below its top speed; "" at that.

    ``command`` is the last one of ``mofis``, None before the first.
    """
    v = verdict.twist.v
    if command is None:
        return "standing still for the gyro's bias"
    if v >= _FULL_SPEED * mofis.commands.max_v:
        return ""
    if verdict.reason:
        return f"safety monitor: {verdict.reason}"
    return "speeding up" if v < command.twist.v - _RAMP else mofis.slower


STUCK_AFTER = 60.0  # chosen
"""Time without progress toward a waypoint [s] after which the stack gives up."""

NO_ROUTE_AFTER = 20.0  # chosen
"""Time without a route [s] after which the stack gives up; a passage may have been misjudged."""

_DETOUR = 1.5  # chosen
"""Distance [m] beyond which the robot is on a detour around what closes its route, and goes on."""


class ProgressWatch:
    """Watches from frame to frame whether the robot makes progress on its route.

    ``give_up_reason`` says why the robot gives up; None while it does not. The watch is ``unsure``
    at a goal if the estimate is too uncertain for the planner to count the goal as reached.
    """

    def __init__(self) -> None:
        self.give_up_reason: str | None = None
        self._unsure_of: signals.Waypoint | None = None
        self._no_route_since: tuple[float, signals.Pose] | None = None
        self._vetoes: Counter[str] = Counter()

    @property
    def unsure(self) -> bool:
        """Whether the estimate has come within the goal's tolerance, too uncertain to count."""
        return self._unsure_of is not None

    def update(
        self,
        now: float,
        belief: signals.Belief,
        waypoint: signals.Waypoint | None,
        idle: float,
        no_route_reason: str | None,
        veto: str = "",
    ) -> None:
        """Update the reasons by a frame at ``now`` [s]; ``idle`` [s] is the time without progress.

        ``no_route_reason`` is the planner's, ``veto`` the safety monitor's for a stop (else empty).
        """
        if idle == 0.0:
            self._vetoes.clear()
        self._vetoes[veto] += 1
        if _is_at(belief, waypoint):
            self._unsure_of = waypoint
        elif waypoint != self._unsure_of:
            self._unsure_of = None
        if no_route_reason is None or waypoint is None:
            self._no_route_since = None
        elif self._no_route_since is None or _away(belief, self._no_route_since[1]) > _DETOUR:
            self._no_route_since = now, belief.pose
        self.give_up_reason = None
        if self._no_route_since is not None and now - self._no_route_since[0] >= NO_ROUTE_AFTER:
            self.give_up_reason = no_route_reason
        elif idle > STUCK_AFTER and waypoint is not None:
            if self.unsure:
                doubt = f"the position estimate has a sigma of {belief.sigma:.2f} m"
                self.give_up_reason = f"perhaps at {waypoint.label}: {doubt}"
            else:
                because = "" if no_route_reason is None else f"; {no_route_reason}"
                what = f"no progress toward {waypoint.label} for {idle:.0f} s"
                self.give_up_reason = f"{what}{because}{self._held()}"

    def _held(self) -> str:
        """Return in words the veto of most frames without progress; empty if there is none."""
        veto, frames = self._vetoes.most_common(1)[0]
        held = bool(veto) and 2 * frames > self._vetoes.total()
        return f"; held by the safety monitor: {veto}" if held else ""


def _is_at(belief: signals.Belief, waypoint: signals.Waypoint | None) -> bool:
    """Return whether the estimate is within the tolerance of a goal, the present waypoint."""
    if waypoint is None or not waypoint.final:
        return False
    return _away(belief, waypoint) <= waypoint.tolerance


def _away(belief: signals.Belief, point: signals.Pose | signals.Waypoint) -> float:
    """Return the distance [m] of a point of the map from the estimated position."""
    return math.hypot(point.x - belief.pose.x, point.y - belief.pose.y)
