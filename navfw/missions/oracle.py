"""True depth, motion and surroundings for the plugins of a stack with ``oracle: true``."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from navfw.errors import SimulationError
from navfw.flow.ideal import Ideal
from navfw.interfaces import Plugin
from navfw.mofis.navground import Navground, Surroundings
from navfw.signals import CameraMotion, Frame, FramePair
from navfw.sim.shapes import Circle, Shape
from navfw.sim.simulation import Simulation
from navfw.stack import Stack


class SimulatorTruth:
    """True depth, motion and surroundings from the simulator.

    Implements ``navfw.flow.ideal.TruthSource`` and
    ``navfw.mofis.navground.SurroundingsSource``.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def depth(self, frame: Frame) -> npt.NDArray[np.float32]:
        """True depth (height, width) [m] of ``frame``.

        Raises:
            SimulationError: ``frame`` is not the newest frame.

        """
        newest = self._simulation.read().frame
        if newest is not frame:
            raise SimulationError(f"{frame.time:.3f} s is not the time of the newest frame")
        return self._simulation.true_depth()

    def motion(self, pair: FramePair) -> CameraMotion:
        """The true camera motion between the frames of ``pair``."""
        return self._simulation.true_motion(pair.past, pair.now)

    def surroundings(self, reach: float) -> Surroundings:
        """Solids and moving bodies within ``reach`` [m] of the robot, in base_link."""
        robot = self._simulation.true_pose()
        position = np.array([[robot.x, robot.y]])
        near = [shape for shape in self._present() if float(shape.distance(position)[0]) <= reach]
        edges, circles, moving = [], [], []
        for shape in near:
            if isinstance(shape, Circle):
                circles.append([*robot.to_local(shape.x, shape.y), shape.radius])
            else:
                corners = [robot.to_local(x, y) for x, y in shape.corners]
                edges += [[corners[i - 1], corners[i]] for i in range(4)]
        for mover in self._simulation.walkers:
            if math.hypot(mover.x - robot.x, mover.y - robot.y) - mover.spec.radius <= reach:
                speed = 0.0 if mover.waiting else mover.spec.speed
                heading = mover.heading - robot.yaw
                velocity = (speed * math.cos(heading), speed * math.sin(heading))
                moving.append([*robot.to_local(mover.x, mover.y), mover.spec.radius, *velocity])
        return Surroundings(
            np.array(edges, np.float64).reshape(-1, 2, 2),
            np.array(circles, np.float64).reshape(-1, 3),
            np.array(moving, np.float64).reshape(-1, 5),
        )

    def _present(self) -> list[Shape]:
        """The outlines of all solids that exist at this time."""
        simulation = self._simulation
        changes = simulation.change_track()
        permanent = [s.shape for s in simulation.plan.solids if s.name not in changes.names]
        now = simulation.time
        return permanent + [p.shape for p in changes.presences if p.begin <= now < p.end]


def reveal(simulation: Simulation, stack: Stack) -> None:
    """Give ``stack`` the truth of ``simulation``, if its stack file has ``oracle: true``."""
    if not stack.resolved.settings.oracle:
        return
    truth = SimulatorTruth(simulation)
    if isinstance(stack.vision.flow.plugin, Ideal):
        stack.vision.flow.plugin.set_truth(truth, simulation.flow_noise)
    for behavior in stack.mofis.behaviors.values():
        if isinstance(behavior, Navground):
            behavior.set_truth(truth)


def plugins_of(stack: Stack) -> dict[str, Plugin]:
    """All plugins of ``stack`` by name."""
    vision, mofis = stack.vision, stack.mofis
    stages = (stack.features, stack.localizer, stack.planner, stack.controller)
    plugins: list[Plugin | None] = [
        vision.flow.plugin,
        vision.perception.plugin,
        *(stage.plugin for stage in stages),
        mofis.composite,
        mofis.fusion,
    ]
    return {plugin.name: plugin for plugin in plugins if plugin is not None} | mofis.behaviors
