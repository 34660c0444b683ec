"""A stack that only perceives while somebody else drives the robot: odometry, vision, local map."""

from __future__ import annotations

import numpy as np

from navfw.localization.motion_model import MotionParams, motion_noise, predict, process_noise
from navfw.localmap.hit_record import HitRecord
from navfw.numerics import Array
from navfw.numerics.products import product
from navfw.robot import RobotModel
from navfw.signals import (
    Belief,
    OccupiedDisc,
    Odometry,
    Percept,
    Pose,
    SensorReading,
    Twist,
)
from navfw.stack.stack import Stack
from navfw.stack.stack_state import StackState
from navfw.stack.stackfile import StackConfig
from navfw.stack.vision import View, ready_frame, straight_reading
from navfw.topomap import TopoMap


class SensingStack(Stack):
    """Runs the perceiving half of a stack; nothing is planned or decided.

    ``hits`` has by what evidence the cells of the local map are occupied. The state's belief is the
    odometry with its covariance, in ``odom``; its percept is None where the newest frame shows no
    depth.
    """

    def __init__(self, config: StackConfig, robot: RobotModel, topo_map: TopoMap) -> None:
        super().__init__(config, robot, topo_map)
        self._noise = motion_noise(MotionParams(), self.robot)

    def _forget(self) -> None:
        super()._forget()
        self.hits = HitRecord(self.local_map.occupancy)
        self._covariance: Array = np.zeros((4, 4))
        self._last: Odometry | None = None

    def _step(self, reading: SensorReading) -> Twist:
        measured = self.odometer.update(reading.inertial, reading.encoders)
        self.history.add(measured)
        self.safety.update(reading, measured)
        reading = straight_reading(reading, self._lens)
        frame = ready_frame(reading.frame, self.robot, self._reduction, self.history)
        odometry = self._corrected(measured, frame)
        if frame is not None:
            seen_from = self._corrected(self.history.at(frame.time))
            view, _ = self._perceive(reading, frame, seen_from)
            moving = self._observe(frame, view, odometry, seen_from.pose)
            belief, percept = self._take(reading, view, odometry, seen_from.pose, moving)
            self.state = StackState(
                reading.time,
                odometry,
                belief,
                view.flows,
                percept,
                sight=self.local_map.sight.judgement,
                faults=tuple(str(fault) for fault in self.guard.faults),
            )
        return odometry.twist

    def _take(
        self,
        reading: SensorReading,
        view: View,
        odometry: Odometry,
        seen_from: Pose,
        moving: tuple[OccupiedDisc, ...],
    ) -> tuple[Belief, Percept | None]:
        """Take in a frame's ``view``, after the local map has; belief and percept of the state."""
        self.local_map.set_obstacles(moving)
        self.hits.update(view.percepts, view.stixels, view.low_things, seen_from, odometry.time)
        self._propagate(odometry)
        return Belief(odometry.time, odometry.pose, self._covariance[:3, :3]), view.percept

    def _propagate(self, odometry: Odometry) -> None:
        """Add what the motion since the last frame adds to the covariance of (x, y, yaw, bias)."""
        last, self._last = self._last or odometry, odometry
        moved, dt = last.pose.relative(odometry.pose), odometry.time - last.time
        state = np.array((last.pose.x, last.pose.y, last.pose.yaw, odometry.yaw_bias))
        _, jacobian = predict(state, moved, 0.0, dt)
        noise = process_noise(last.pose.yaw, moved, dt, self._noise, odometry)
        self._covariance = product(jacobian, self._covariance, jacobian.T) + noise
        if odometry.still:
            self._covariance[3, :3] = self._covariance[:3, 3] = 0.0
            self._covariance[3, 3] = self._noise.bias**2
