"""Navground's human-like navigation with perfect knowledge of obstacles, to be compared with.

Guzzi et al., Human-friendly robot navigation in dynamic environments (ICRA 2013), as the package
``navground`` has it, an optional extra. No robot knows its surroundings so well: the plugin
declares ``oracle``, and a mission gives it the truth.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from navfw.config.extras import extra_imports
from navfw.context import Context, peak
from navfw.errors import PluginError
from navfw.interfaces import Behavior
from navfw.numerics import Array
from navfw.robot import RobotModel
from navfw.signals import Proposal
from navfw.sim.shapes import Circle

if TYPE_CHECKING:
    from navfw.missions import SimulatorTruth


_HORIZON, _MARGIN = 3.0, 0.08
"""How far it looks, and the distance kept from things [m]."""
_ETA, _TAU, _ROTATION_TAU = 0.5, 0.125, 0.5
"""Time that it keeps away from contacts, and relaxation times of speed and turn [s]."""
_RESOLUTION = 101
"""Directions that it tries."""

Surroundings: TypeAlias = tuple[Sequence[Any], Sequence[Any], Sequence[Any]]
"""Obstacles at the robot's height in base_link: both ends of the sides of walls and boxes;
cylinders: x, y, radius [m]; movers: x, y, radius [m] and velocity [m/s]."""


class Navground(Behavior):
    """Navground's HL behaviour: turns to the direction that leads nearest to the waypoint.

    Its input is the true position of all obstacles around the robot, and no camera image.
    Its twist is proposed as the only one worth desiring.
    """

    name: ClassVar[str] = "navground"
    oracle: ClassVar[bool] = True

    def __init__(self, robot: RobotModel, params: Behavior.Params | None = None) -> None:
        super().__init__(robot, params)
        self._core = _navground("navground.core")
        self._truth: SimulatorTruth | None = None

    def set_truth(self, truth: SimulatorTruth) -> None:
        """Take the surroundings from ``truth`` from now on."""
        self._truth = truth

    def propose(self, context: Context) -> Proposal:
        """Desire navground's twist toward the waypoint.

        Raises:
            PluginError: no source of truth was set.

        """
        commands = context.commands
        if context.waypoint is None:
            return Proposal(0.0, commands.zeros(), commands.zeros(), "no waypoint")
        if self._truth is None:
            raise PluginError(
                "needs the simulator's truth, which only a mission can give", key=self.name
            )
        around = surroundings(self._truth, _HORIZON)
        v, w = self._ask(context, around)
        return Proposal(
            applicability=1.0,
            desirability=commands.product(
                _peak(v, commands.v, commands.max_v), _peak(w, commands.w, commands.max_w)
            ),
            prohibition=commands.zeros(),
            reason="{} edges, {} discs and {} walkers around".format(*map(len, around)),
        )

    def _ask(self, context: Context, around: Surroundings) -> tuple[float, float]:
        """Navground's command (v [m/s], w [rad/s]); all inputs are in base_link."""
        core, (edges, discs, walkers) = self._core, around
        agent = self._agent(context)
        state = agent.environment_state
        state.line_obstacles = [core.LineSegment(tuple(a), tuple(b)) for a, b in edges]
        state.static_obstacles = [core.Disc((x, y), r) for x, y, r in discs]
        state.neighbors = [
            core.Neighbor((x, y), r, (vx, vy), number)
            for number, (x, y, r, vx, vy) in enumerate(walkers)
        ]
        twist = agent.compute_cmd(1.0 / self.robot.camera.rate, core.Frame.relative)
        return float(twist.velocity[0]), float(twist.angular_speed)

    def _agent(self, context: Context) -> Any:
        """A fresh agent at the origin, as fast as the robot, on its way to the waypoint."""
        core, commands = self._core, context.commands
        kinematics = _navground("navground.core.kinematics").TwoWheelsDifferentialDriveKinematics(
            max_speed=commands.max_v, wheel_axis=self.robot.track
        )
        agent = _navground("navground.core.behaviors").HLBehavior(kinematics, self.robot.radius)
        agent.max_angular_speed = commands.max_w
        agent.optimal_speed = commands.max_v
        agent.horizon, agent.safety_margin = _HORIZON, _MARGIN
        agent.eta, agent.tau, agent.rotation_tau = _ETA, _TAU, _ROTATION_TAU
        agent.resolution = _RESOLUTION
        agent.assume_cmd_is_actuated = False
        agent.pose = core.Pose2((0.0, 0.0), 0.0)
        agent.twist = core.Twist2((context.twist.v, 0.0), context.twist.w, core.Frame.relative)
        agent.actuated_twist = agent.twist
        agent.target = core.Target.Point(context.waypoint_local, 0.05)
        return agent


def surroundings(truth: SimulatorTruth, reach: float) -> Surroundings:
    """The obstacles within ``reach`` [m] of the robot now."""
    simulation = truth.simulation
    robot, now, changes = simulation.true_pose(), simulation.time, simulation.change_track()
    shapes = [s.shape for s in simulation.plan.solids if s.name not in changes.names]
    shapes += [p.shape for p in changes.presences if p.begin <= now < p.end]
    edges, discs = [], []
    for shape in shapes:
        if float(shape.distance(np.array([[robot.x, robot.y]]))[0]) > reach:
            continue
        if isinstance(shape, Circle):
            discs.append((*robot.to_local(shape.x, shape.y), shape.radius))
        else:
            corners = [robot.to_local(x, y) for x, y in shape.corners]
            edges += [(corners[i - 1], corners[i]) for i in range(4)]
    walkers = [w for w in truth.walkers(robot) if math.hypot(*w[:2]) - w[2] <= reach]
    return edges, discs, walkers


def _navground(module: str) -> Any:
    """A module of the package, which need not be installed."""
    with extra_imports("navground", key=Navground.name):
        return importlib.import_module(module)


def _peak(value: float, values: Array, most: float) -> Array:
    """``value``, kept within ``values`` (n,) and ``most``, as a triangle that is not any wider."""
    value = min(most, max(float(values[0]), value if math.isfinite(value) else 0.0))
    return peak(value, values, steps=1.01)
