"""The simulation of a world with a robot, advanced by the mission loop.

Physics runs at 240 Hz, control at the robot's control rate, the camera at its own rate, all in
simulated time: the wall clock is read only for timings.
"""

from __future__ import annotations

import math
import time as wall
from array import array
from bisect import bisect_left
from collections.abc import Iterable
from typing import Literal

import numpy as np

from navfw.errors import SimulationError, WorldError
from navfw.numerics import Image
from navfw.robot import RobotModel
from navfw.signals import CameraMotion, Frame, Pose, SensorReading, wrap_angle
from navfw.sim import world_changes
from navfw.sim.camera import DepthImage
from navfw.sim.camera_rig import CameraRig, Timings
from navfw.sim.engine import BulletConnection, SimulatorWindow, quaternion
from navfw.sim.event_actions import EventAction, InjectedFaults
from navfw.sim.physics_world import PhysicsWorld
from navfw.sim.robot_body import BodyState, ContactPoint, UrdfBody, make_body, pose_of
from navfw.sim.scene_geometry import SceneGeometry
from navfw.sim.scenery import Scenery
from navfw.sim.sensor_models import GyroModel, SensorParams, WheelEncoderModel
from navfw.sim.solids import fallen_into
from navfw.sim.world_check import check_world
from navfw.sim.worldspec import WorldSpec

_FINE, _COARSE = (240, 50), (60, 10)
"""Physics steps per second, and iterations of the solver in each. The coarse ones halve a step's
time, and change the end of a path of 5 m by 2 cm."""
_SETTLING_TIME = 0.25
"""Time [s] of physics before time 0, in which the robot comes to rest on its wheels."""
_GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""


class Simulation(BulletConnection):
    """One run of a robot in a world. Use it as a context manager, or ``close()`` it.

    With ``landmark_frames`` the camera also captures the larger frames of ``robot.landmark_view``.
    ``read()`` returns the robot's sensor readings; ``true_pose``, ``true_depth``, ``contacts``,
    ``walkers`` and ``plan`` are ground truth, only for metrics and tests. ``window`` is the window
    with ``gui``, else None. If not ``drawn``, images have no content, as for ``ideal`` flow. If
    ``coarse``, the physics takes longer steps. A new Simulation with the same arguments and the
    same commands gives the same readings, bit for bit.

    Raises:
        WorldError: the world's geometry is impossible, or the start is not free.
        SimulationError: PyBullet cannot be started.

    """

    def __init__(
        self,
        world: WorldSpec,
        robot: RobotModel,
        start: Pose,
        seed: int,
        sensors: SensorParams | None = None,
        gui: bool = False,
        landmark_frames: bool = False,
        drawn: bool = True,
        coarse: bool = False,
    ) -> None:
        self._rate, iterations = _COARSE if coarse else _FINE
        sensors = SensorParams() if sensors is None else sensors
        check_world(world)
        self.world, self.robot = world, robot
        self.plan = SceneGeometry.from_world(world, robot.height)
        for x, y, radius in robot.discs:
            self.plan.check_free(*start.to_parent(x, y), radius, "the start")
        self.walkers = tuple(world_changes.Walker(spec) for spec in world.movers)
        _check_apart(self.walkers, start, robot.reach)
        self.timings, self._steps, self.time = Timings(), 0, 0.0
        self.window: SimulatorWindow | None = None
        super().__init__(gui)
        self._contacts: set[str] = set()
        self._cause: Literal["robot", "mover"] | None = None
        self._last_pose = start
        self._true_state: tuple[BodyState, Pose] | None = None
        # a list of arrays would take ten times the memory
        self._walker_times, self._walker_points, self._robot_points = (array("d") for _ in range(3))
        self._reading: SensorReading | None = None
        # one generator for each component: draws of one do not change those of another
        generators = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(7))
        for_camera, for_gyro, for_encoders, for_faults, for_landmarks, *others = generators
        self._faults, (for_their_faults, self.flow_noise) = InjectedFaults(for_faults), others
        self._landmark_faults = InjectedFaults(for_their_faults)
        try:
            self._set_up_engine(gui, iterations)
            scenery = Scenery(world, None if self.window is None else self.window.display)
            self._physics = PhysicsWorld(world, self._client, scenery)
            self._changes = world_changes.WorldChanges(world, self._physics)
            self._body = make_body(robot, self._client, start, self._physics.floor)
            self._rig = CameraRig(
                robot,
                world.light,
                scenery,
                sensors,
                self.timings,
                for_camera,
                self._faults,
                for_landmarks if landmark_frames else None,
                self._landmark_faults,
                drawn,
            )
            self._gyro = GyroModel(sensors, for_gyro)
            self._encoders = WheelEncoderModel(sensors, robot, for_encoders)
            self._settle()
        except BaseException:
            self.close()
            raise

    def _set_up_engine(self, gui: bool, iterations: int) -> None:
        """Set the physics' parameters, and take hold of the window."""
        self._call("setGravity", 0.0, 0.0, -_GRAVITY)
        self._call("setTimeStep", 1.0 / self._rate)
        parameters = {"deterministicOverlappingPairs": 1, "numSolverIterations": iterations}
        self._call("setPhysicsEngineParameter", **parameters)
        if gui:
            self.window = SimulatorWindow(self._client)

    def _settle(self) -> None:
        """Let the robot come to rest on its wheels before time begins; then show it."""
        for _ in range(round(_SETTLING_TIME * self._rate)):
            self._call("stepSimulation")
        if isinstance(self._body, UrdfBody):
            self._body.set_level()
        self._place_walkers()
        self._record_walkers()
        self._last_pose = self.true_pose()
        self._encoders.reset(self._body.wheel_angles())
        self._yaw_read = self._last_pose.yaw
        if self.window is not None:
            self.window.show(self._last_pose.x, self._last_pose.y)

    # --- sensors and wheels, for the robot ----------------------------------------------------

    def read(self) -> SensorReading:
        """Return the current sensor readings, with a camera frame if one is due.

        Called again before ``advance``, it returns the same reading and draws no noise.
        """
        if self._reading is not None and self._reading.time == self.time:
            return self._reading
        begun = wall.perf_counter()
        dt = self.time - self._reading.time if self._reading is not None else 0.0
        state, pose = self._truth()
        self._rig.record(self.time, state)
        yaw_rate = wrap_angle(pose.yaw - self._yaw_read) / dt if dt > 0.0 else 0.0
        self._yaw_read = pose.yaw
        rates = (*self._body.roll_pitch_rates(state, dt), yaw_rate)
        inertial = self._faults.apply_gyro(self._gyro.read(self.time, dt, rates))
        encoders = self._faults.apply_encoders(
            self._encoders.read(self.time, dt, self._body.wheel_angles())
        )
        self.timings.sensors += wall.perf_counter() - begun
        due = self._rig.is_due(self.time)
        if due:
            self._physics.update_walker_visuals()
        captured = self._rig.capture(self.time, state) if due else None
        landmark_frame = self._rig.capture_landmarks(self.time, state if due else None)
        frame = self._faults.transport(self.time, captured)
        self._reading = SensorReading(self.time, inertial, encoders, frame, landmark_frame)
        return self._reading

    def drive(self, left: float, right: float) -> None:
        """Set the wheels' target speeds [rad/s], forward positive; torque is limited."""
        if not (math.isfinite(left) and math.isfinite(right)):
            raise SimulationError(f"wheel speeds must be finite, got {left}, {right}")
        self._body.set_wheel_speeds(*self._faults.apply_wheels(left, right))

    def begin(self, action: EventAction) -> None:
        """Begin an event's action: a fault or a change of the world."""
        if isinstance(action, world_changes.WorldChange):
            self._changes.begin(action)
        else:
            self._faults.begin(action)
            self._landmark_faults.begin(action)
        self._apply_actions()

    def end(self, action: EventAction) -> None:
        """End an event's action: undo what ``begin`` did."""
        if isinstance(action, world_changes.WorldChange):
            self._changes.end(action)
        else:
            self._faults.end(action)
            self._landmark_faults.end(action)
        self._apply_actions()

    def _apply_actions(self) -> None:
        self._changes.update(self.time, self.true_pose(), self.robot.reach)
        self._rig.update_optics()
        self._encoders.more_slip = self._faults.slip

    def advance(self, dt: float) -> None:
        """Simulate ``dt`` [s] in whole physics steps; a remainder is added to the next call's."""
        begun = wall.perf_counter()
        self.time += dt
        self._contacts = set()
        target = round(self.time * self._rate)
        if abs(self.time - target / self._rate) < 1e-9:
            self.time = target / self._rate  # against accumulating rounding errors
        pose = self.true_pose() if self.walkers else self._last_pose
        for walker in self.walkers:
            walker.update_waiting(pose, self.robot.reach)
        self._true_state = None
        while self._steps < target:
            for walker in self.walkers:
                walker.advance(1.0 / self._rate)
            self._place_walkers()
            self._call("stepSimulation")
            if points := self._body.contacts():
                self._record_contacts(points, pose, dt)
            self._steps += 1
            self.timings.steps += 1
        if self.world.drops:
            drop = fallen_into(self.world, self._body.support_points())
            if drop is not None:
                self._contacts.add(drop)
                self._cause = self._cause or "robot"
        self._last_pose = pose
        self._record_walkers()
        if not self._changes.settled:
            self._changes.update(self.time, self.true_pose(), self.robot.reach)
        self.timings.physics += wall.perf_counter() - begun

    def _place_walkers(self) -> None:
        for walker, body in zip(self.walkers, self._physics.walkers, strict=True):
            self._call(
                "resetBasePositionAndOrientation",
                body,
                (walker.x, walker.y, 0.5 * walker.spec.height),
                quaternion(walker.heading),
            )

    def _record_walkers(self) -> None:
        if self.walkers:
            self._walker_times.append(self.time)
            for walker in self.walkers:
                self._walker_points.extend((walker.x, walker.y))
            pose = self.true_pose()
            self._robot_points.extend((pose.x, pose.y))

    def _record_contacts(self, points: Iterable[ContactPoint], pose: Pose, dt: float) -> None:
        """Record the names of the bodies in contact; at the first contact of the run, its cause."""
        names = {self._physics.name_at(*contact) for contact in points}
        self._contacts |= names
        if self._cause is None:
            touched = [k for k, walker in enumerate(self.walkers) if walker.spec.name in names]
            by_walker = len(touched) == len(names) and not any(
                self._caused(pose, dt, index) for index in touched
            )
            self._cause = "mover" if by_walker else "robot"

    def _caused(self, pose: Pose, dt: float, index: int) -> bool:
        """Whether the robot, at ``pose`` before a contact, caused that with the walker ``index``.

        Its speed is that of the previous control period: the contact changes it.
        """
        since = bisect_left(self._walker_times, self.time - world_changes.CLOSING_TIME)
        count = len(self.walkers)
        robot = np.array(self._robot_points[2 * since :]).reshape(-1, 2)
        walkers = np.array(self._walker_points[2 * count * since :]).reshape(-1, count, 2)
        walker = walkers[:, index]
        return world_changes.closed_by_robot(robot, walker) or world_changes.caused_by_robot(
            self._last_pose, pose, dt, self.walkers[index]
        )

    # --- the truth, for metrics and tests -----------------------------------------------------

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of bodies that touched the base, and of drops fallen into, sorted.

        They are those since the last ``advance`` began; the floor is not included.
        """
        return tuple(sorted(self._contacts)) if self._contacts else ()

    @property
    def collision_cause(self) -> Literal["robot", "mover"] | None:
        """The body that caused the first contact of the run; None before it.

        "mover" if only walkers were in contact and the robot neither approached them faster than
        ``navfw.sim.world_changes.CLOSING_SPEED`` nor closed most of the distance in the last
        second, else "robot".
        """
        return self._cause

    def walker_track(self) -> world_changes.WalkerTrack:
        """Return the walkers' positions so far, recorded at every ``advance``."""
        shape = len(self._walker_times), len(self.walkers), 2
        return world_changes.WalkerTrack(
            names=tuple(walker.spec.name for walker in self.walkers),
            radii=np.array([walker.spec.radius for walker in self.walkers]),
            time=np.array(self._walker_times),
            points=np.array(self._walker_points).reshape(shape),
        )

    def change_track(self) -> world_changes.ChangeTrack:
        """Return the solids that were present only part of the time so far: doors, obstacles."""
        return self._changes.track()

    def true_pose(self) -> Pose:
        """Return the robot's true pose in ``map``."""
        return self._truth()[1]

    def true_depth(self) -> DepthImage:
        """True depth (height, width) [m] of the last frame; inf where no surface is visible."""
        return self._rig.true_depth()

    def true_motion(self, past: Frame, now: Frame) -> CameraMotion:
        """Return the true motion of the camera between two recent frames, pitch and roll included.

        Raises:
            SimulationError: one of the frames is not from this simulation, or too old.

        """
        return self._rig.true_motion(past, now)

    def render_from(self, pose: Pose) -> tuple[Image, DepthImage]:
        """Render an image without noise and its true depth [m] from any ``pose`` of the robot."""
        self._physics.update_walker_visuals()
        image, raw = self._rig.camera.render((pose.x, pose.y, 0.0), quaternion(pose.yaw))
        return image, self._rig.camera.depth(raw)

    def _truth(self) -> tuple[BodyState, Pose]:
        """Return the true body state and pose; read from PyBullet once between advances."""
        if self._true_state is None:
            state = self._body.state()
            self._true_state = state, pose_of(state)
        return self._true_state


def _check_apart(walkers: tuple[world_changes.Walker, ...], start: Pose, radius: float) -> None:
    for walker in walkers:
        free = math.hypot(walker.x - start.x, walker.y - start.y) - walker.spec.radius
        if free < radius:
            raise WorldError(
                f"the start ({start.x:g}, {start.y:g}) is {max(free, 0.0):.2f} m from"
                f" {walker.spec.name!r} when time begins, the robot needs {radius:g} m: choose"
                " another start or phase"
            )
