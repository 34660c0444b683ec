"""Gives the simulator's truth to the plugins of a stack with ``oracle: true``."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import numpy.typing as npt

from navfw.errors import SimulationError
from navfw.flow.ideal import Ideal
from navfw.interfaces import Plugin
from navfw.numerics.products import product
from navfw.signals import CameraMotion, Frame, FramePair, MovingObject, Pose
from navfw.sim.simulation import Simulation
from navfw.stack import Stack

_SEEN = (0.3, 0.9, 1.3, 1.8, 2.3, 2.8, 3.3), (0.6, 0.8, 0.75, 0.6, 0.4, 0.12, 0.0)
"""Distances [m], and the share of frames in which a walker in view at each is detected."""
_ERRORS = 0.05, 0.12, 0.15, 0.15
"""Standard deviations of a detection's bearing [rad], distance (relative), velocity [m/s]."""


class SimulatorTruth:
    """True depth and motion from the simulator; a ``navfw.flow.ideal.TruthSource``."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation

    def depth(self, frame: Frame) -> npt.NDArray[np.float32]:
        """Return the true depth (height, width) [m] along the optical axis of ``frame``.

        Raises:
            SimulationError: ``frame`` is not the newest frame.

        """
        newest = self.simulation.read().frame
        if newest is not frame:
            raise SimulationError(f"{frame.time:.3f} s is not the time of the newest frame")
        return self.simulation.true_depth()

    def motion(self, pair: FramePair) -> CameraMotion:
        """Return the true camera motion between the frames of ``pair``."""
        return self.simulation.true_motion(pair.past, pair.now)

    def moving_objects(self, frame: Frame, *_: object) -> tuple[MovingObject, ...]:
        """Walkers in view as detections, with misses and errors as measured (decision 154)."""
        simulation, model = self.simulation, self.simulation.robot
        view = 0.5 * sum(camera.hfov for camera in (model.camera, *model.side_cameras))
        robot, noise = simulation.true_pose(), simulation.flow_noise
        in_sight = partial(simulation.plan.straight_path_free, radius=0.01)
        eye = Pose(*robot.to_parent(model.camera.mount_forward, 0.0), robot.yaw)
        detections: list[MovingObject] = []
        for x, y, radius, *velocity in self.walkers(eye):
            away, bearing = max(math.hypot(x, y) - radius, 0.1), math.atan2(y, x)
            is_noticed = any(velocity) and noise.random() < np.interp(away, *_SEEN)
            ends = np.array([[eye.x, eye.y], eye.to_parent(x, y)])
            if is_noticed and abs(bearing) <= view and in_sight(*ends):
                *errors, along, across = noise.standard_normal(4) * _ERRORS
                information = np.eye(2) / _ERRORS[-1] ** 2
                place = bearing + errors[0], math.atan2(radius, away), away * (1.0 + errors[1])
                evidence = product(information, np.add(velocity, (along, across)))
                detections.append(MovingObject(frame.time, *place, information, evidence))
        return tuple(detections)

    def walkers(self, axes: Pose) -> list[tuple[float, ...]]:
        """Return x, y, radius [m] and velocity [m/s] of each walker, in the frame of ``axes``."""
        walkers: list[tuple[float, ...]] = []
        for walker in self.simulation.walkers:
            speed = 0.0 if walker.waiting else walker.spec.speed
            heading = walker.heading - axes.yaw
            velocity = speed * math.cos(heading), speed * math.sin(heading)
            walkers.append((*axes.to_local(walker.x, walker.y), walker.spec.radius, *velocity))
        return walkers


def reveal(simulation: Simulation, stack: Stack, *, drawn: bool = True) -> None:
    """Give the simulator's truth to a ``stack`` with ``oracle: true``; walkers if not ``drawn``."""
    if not stack.resolved.settings.oracle:
        return
    truth = SimulatorTruth(simulation)
    if isinstance(stack.vision.flow.plugin, Ideal):
        stack.vision.flow.plugin.set_truth(truth, simulation.flow_noise)
    if not drawn:
        stack.vision.detect = truth.moving_objects
    for behavior in stack.mofis.behaviors.values():
        if behavior.oracle and hasattr(behavior, "set_truth"):
            behavior.set_truth(truth)


def plugins_of(stack: Stack) -> dict[str, Plugin]:
    """Return all plugins of ``stack`` by name."""
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
