"""``navfw ros drive``: run the stack as a node of ROS 2."""

from __future__ import annotations

import gc
import json
import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from navfw.errors import InputError, UnknownNameError
from navfw.process.interruption import check_interrupted
from navfw.recording import planar_pose, ros_message
from navfw.recording.bag_topics import info_topics
from navfw.recording.ros_messages import command_message, twist_fields
from navfw.ros.connection import Quality, RosNode
from navfw.ros.drive_outputs import DriveOutputs, text_message
from navfw.ros.live_parameters import LiveParameters
from navfw.ros.map_keeper import NAME_PLACE, MapKeeper
from navfw.ros.sensor_inputs import SensorInputs, goal_at, posed_goal
from navfw.ros.topic_watch import TopicWatch
from navfw.signals import Pose, SensorReading, Twist, Waypoint
from navfw.stack import Stack, halt
from navfw.stack.sensing_stack import SensingStack

_MAX_AGE = 0.2
"""Age [s] of the last command at which the robot is stopped, whatever the stack does."""
_SILENT = 0.15
"""Time [s] without wheels after which ticks follow the other sensors, and wheels are ignored.
Wheels of 10 Hz may be late by half their period, and a command may be 0.2 s old."""
_ODD, _MAX_PERIOD = 0.75, 0.1
"""Least time between two ticks, in periods; longest time [s] that the controller is given."""
_MAX_EARLY = 30
"""Largest number of images dropped while their camera_info is published and has not come."""
_STILL = 0.02
"""Speed [m/s] and turning rate [rad/s] up to which the robot counts as standing."""
_STAND = Twist(0.0, 0.0)
_STOPPED, _INACTIVE = "stopped by ~/stop", "inactive"
"""Reasons why the robot is held."""
_TF = "tf2_msgs/msg/TFMessage"
_SNAP = 240.0
"""Rate [Hz] of the steps of which the times of ``navfw ros sim`` are multiples."""

TOPICS: Mapping[str, tuple[str, str]] = {
    "image": ("sensor_msgs/msg/Image", "the camera; with `compressed`, image/compressed"),
    "imu": ("sensor_msgs/msg/Imu", "rates; turned to base_link by /tf_static, or by imu_rpy"),
    "joint_states": ("sensor_msgs/msg/JointState", "positions of the wheels"),
    "odom": ("nav_msgs/msg/Odometry", "in place of joint_states, with wheels:=odom"),
    "landmark_image": ("sensor_msgs/msg/Image", "full resolution, rectified, to find markers"),
    "camera_info": ("sensor_msgs/msg/CameraInfo", "lens of image, also found beside it"),
    "goal_pose": ("geometry_msgs/msg/PoseStamped", "a goal, as of RViz's button"),
    "goal_place": ("std_msgs/msg/String", "a goal by the name of a place"),
    "initialpose": ("geometry_msgs/msg/PoseWithCovarianceStamped", "where the robot is"),
    NAME_PLACE: ("std_msgs/msg/String", "names the robot's place on a growing map"),
}
"""Topics that the node subscribes to: type, and meaning."""


@dataclass(frozen=True)
class DriveOptions:
    """Where a drive begins (None: unknown) and goes; ``once``: it ends at the last goal."""

    start: Pose | None
    goals: tuple[Waypoint, ...]
    once: bool
    lockstep: bool = False


class DriveNode:
    """Drives one robot by ``stack``, until a signal; ``outputs`` publish its state.

    A stack that only perceives commands nothing. With a ``keeper`` of the map that grows there are
    no other goals than those of ``options``, and no other start: the map begins there. Parameters
    of the node: ``wheels`` (joints or odom), ``wheel_joints``, ``imu_rpy`` [rad], ``compressed``,
    ``stamped_cmd_vel``.
    """

    def __init__(
        self,
        node: RosNode,
        stack: Stack,
        options: DriveOptions,
        keeper: MapKeeper | None = None,
        outputs: DriveOutputs | None = None,
    ) -> None:
        self._node, self._stack, self._options, self._keeper = node, stack, options, keeper
        self._steers = not isinstance(stack, SensingStack)
        self._robot = stack.robot
        self._period = 1.0 / self._robot.control_rate
        joints = node.parameter("wheel_joints", ["", ""])
        rpy = node.parameter("imu_rpy", [0.0, 0.0, 0.0])
        snap = _SNAP if options.lockstep else 0.0
        named = joints if all(joints) else ()
        compressed = node.parameter("compressed", False)
        self._image = "image/compressed" if compressed else "image"
        images, whole = node.resolved(self._image), self._robot.with_camera(stack.camera)
        self._inputs = SensorInputs(whole, node.note, named, rpy, snap, images)
        self._stamped = node.parameter("stamped_cmd_vel", True)
        self._early = 0 if options.lockstep else _MAX_EARLY
        self._images = list[str]()
        self._watch = TopicWatch(node, ": the robot stands" if self._steers else "")
        self._ticked = node.seconds()
        self._latest = self._stepped = -math.inf
        self._goals = options.goals
        self._held, self._halted = set[str](), False
        self._base: Pose | None = None
        self._image_came = 0.0, 0.0
        self._sent, self._told = math.inf, ""
        self._sending = threading.Lock()
        self._subscribe(node.parameter("wheels", "joints"))
        self._command: Callable[[bytes], None] = lambda _: None
        if self._steers:
            velocity = "TwistStamped" if self._stamped else "Twist"
            self._command = node.publisher("cmd_vel", f"geometry_msgs/msg/{velocity}")
        self._status: Callable[[bytes], None] = lambda _: None
        if self._steers or keeper is not None:
            self._status = node.publisher("navfw/status", "std_msgs/msg/String", "latched")
        self.outputs = outputs or DriveOutputs(node, stack)
        LiveParameters(node, stack)

    def _subscribe(self, wheels: str) -> None:
        node, inputs = self._node, self._inputs
        if wheels not in {"joints", "odom"}:
            raise UnknownNameError("value of wheels", wheels, ["joints", "odom"], key="--ros-args")
        quality: Quality = "reliable" if self._options.lockstep else "sensor"

        def hear(topic: str, kind: str, take: Any, **more: Any) -> None:
            def receive(message: Any) -> None:
                self._watch.hear(topic)
                take(topic, message, 1e-9 * node.now(), **more)

            node.subscribe(topic, kind, receive, quality)

        kind = TOPICS["image"][0]
        packed = kind.replace("Image", "CompressedImage")
        rolled = "joint_states" if wheels == "joints" else "odom"
        for topic in (self._image, "imu", rolled):
            self._watch.expect(topic)
        hear(self._image, kind if self._image == "image" else packed, self._take_image)
        if self._stack.features.plugin.landmark_frames:
            hear("landmark_image", kind, inputs.image, landmarks=True)
        hear("imu", TOPICS["imu"][0], inputs.imu)
        hear(rolled, TOPICS[rolled][0], self._take_wheels)
        if node.has_type(_TF):
            node.subscribe("/tf_static", _TF, inputs.mounts, "latched")
            node.subscribe("odom", TOPICS["odom"][0], self._take_base, quality)
        beside = info_topics(node.resolved(self._image))[0]
        self._infos = tuple(dict.fromkeys((node.resolved("camera_info"), beside)))
        for info in self._infos:
            describe = partial(inputs.camera.describe, info)
            node.subscribe(info, TOPICS["camera_info"][0], describe, quality)
        if self._steers:
            node.serve("stop", self._stop)
            node.serve("resume", self._resume)
        self._end_goal: Callable[[bool], None] = lambda _: None
        if self._keeper is None and self._steers:
            self._subscribe_goals()
        node.manage(lambda: self._held.discard(_INACTIVE), lambda: self._hold(_INACTIVE))

    def _subscribe_goals(self) -> None:
        node = self._node
        node.subscribe("goal_pose", TOPICS["goal_pose"][0], self._take_goal, "reliable")
        node.subscribe("goal_place", TOPICS["goal_place"][0], self._take_place, "reliable")
        node.subscribe("initialpose", TOPICS["initialpose"][0], self._take_start, "reliable")
        node.serve("cancel", self._cancel)
        kind = "nav2_msgs/action/NavigateToPose"
        self._end_goal = node.serve_action(
            "navigate_to_pose", kind, lambda goal: self._take_goal(goal.pose), self._cancel
        )

    # --- what comes in ---------------------------------------------------------------------------

    def _take_image(self, topic: str, message: Any, now: float) -> None:
        # one image of another lens would show motion that there is not
        early = self._early and not self._inputs.camera.described
        if early and any(map(self._node.publishers, self._infos)):
            self._early -= 1
            return
        self._inputs.image(topic, message, now)
        stamp = self._inputs.stamp_of(self._inputs.newest_of(topic))
        self._image_came = time.monotonic(), now - 1e-9 * stamp

    def _take_wheels(self, topic: str, message: Any, now: float) -> None:
        take = self._inputs.joints if hasattr(message, "position") else self._inputs.odometry
        if take(topic, message, now):
            self._latest = self._inputs.newest_of(topic)
            self._images = message.header.frame_id.split("+")[1:]

    def _take_base(self, message: Any) -> None:
        """Keep the robot's own odometry: the robot then publishes the transform to base_link."""
        self._base = Pose(*planar_pose(message))

    def _take_goal(self, message: Any) -> bool:
        """Go to the position of a ``PoseStamped`` in ``map``; return whether that is possible."""
        try:
            return self._go_to(posed_goal(self._stack.topo_map, message))
        except InputError as error:
            self._node.note(f"a goal on goal_pose is left out: {error}")
            return False

    def _take_place(self, message: Any) -> None:
        try:
            self._go_to(goal_at(self._stack.topo_map, str(message.data)[:100]))
        except UnknownNameError as error:
            self._node.note(f"a goal on goal_place is left out: {error}")

    def _go_to(self, goal: Waypoint) -> bool:
        try:
            self._stack.head_for([goal])
        except Exception as error:  # a planner may be a plugin
            self._node.note(f"a goal is left out: {error}")
            return False
        self._end_goal(False)
        self._goals, self._told = (goal,), ""
        self._node.say(f"to {goal.place or f'({goal.x:.2f}, {goal.y:.2f})'}")
        return True

    def _take_start(self, message: Any) -> None:
        x, y, yaw = planar_pose(message)
        if not all(map(math.isfinite, (x, y, yaw))):
            self._node.note("a pose on initialpose is left out: it is not a number")
            return
        self._start(Pose(x, y, yaw))

    def _start(self, pose: Pose | None) -> None:
        """Begin anew at ``pose``, for the goals that are still ahead."""
        state, at = self._stack.state, 0
        if (last := next((point for point in state.path if point.final), None)) is not None:
            places = [(goal.x, goal.y) for goal in self._goals]
            at = places.index((last.x, last.y)) if (last.x, last.y) in places else 0
        self._goals = () if state.finished else self._goals[at:]
        self._stack.start(pose, self._goals)
        self._stepped = -math.inf

    def _hold(self, why: str) -> None:
        self._held.add(why)
        self._stand()

    def _stop(self) -> str:
        self._hold(_STOPPED)
        return "the robot stands until ~/resume"

    def _resume(self) -> str:
        self._held.discard(_STOPPED)
        state = self._stack.state
        if self._keeper is None and (state.fault is not None or state.stuck):
            belief = state.belief
            self._start(None if belief is None or belief.lost else belief.pose)
        return "driving on" if not self._held else f"still {', '.join(self._held)}"

    def _cancel(self) -> str:
        self._goals = ()
        self._stack.head_for([])
        self._stand()
        return "the goals are dropped"

    # --- the loop --------------------------------------------------------------------------------

    def run(self, about: str) -> str:
        """Drive until a signal or, with ``once``, the end; return how it ended, in a sentence.

        ``about`` says what drives, for the log.
        """
        self._node.say(about)
        self.begin()
        gc.freeze()  # one pass of garbage collection over what is loaded costs 0.1 s
        with self._guarded():
            while not (ended := self.advance(0.5 * self._period)):
                check_interrupted()
            return ended

    def begin(self) -> None:
        """Start the stack; raises the errors of ``Stack.start``."""
        self._stack.start(self._options.start, self._options.goals)

    def advance(self, seconds: float) -> str:
        """Wait up to ``seconds`` [s] for messages, and run all ticks that are due; after ``begin``.

        Returns how a drive with ``once`` ended, in a sentence; "" if it goes on or is held.
        """
        self._node.spin(seconds)
        began, readings = self._node.seconds(), list(self._due())
        twists = [self._step(reading) for reading in readings]
        if not readings:
            return ""
        state, at, lasted = self._stack.state, readings[-1].time, self._node.seconds() - began
        if lasted > _MAX_AGE and self._steers and not self._options.lockstep:
            self._node.note(f"decisions take more than {_MAX_AGE} s: the robot stands meanwhile")
            self._halted = True
        stands = self._held or self._halted or state.fault or state.stuck
        self._send(_STAND if stands else twists[-1], at)
        ended = self._ended()
        frame = next((reading.frame for reading in readings if reading.frame is not None), None)
        if frame is not None:
            self._watch.tell_rivals()
            came_at, age = self._image_came
            self.outputs.latencies.append(max(0.0, age) + time.monotonic() - came_at)
            seen_at = self._inputs.stamp_of(state.time)
            self.outputs.tell(frame, self._base, ended or ", ".join(self._held), seen_at)
            if self._keeper is not None:
                self._keeper.tell(seen_at)
        if ended and ended != self._told:
            self._node.say(ended)
            self._end_goal(ended == "reached")
        self._told = ended
        return ended if self._options.once and not self._held else ""

    @contextmanager
    def _guarded(self) -> Any:
        """Context that stops the robot at its end, and while no command is new."""
        over = threading.Event()

        def watch() -> None:
            while not over.wait(0.1 * _MAX_AGE):
                if self._node.seconds() - self._sent > 0.9 * _MAX_AGE:
                    self._stand()

        watchdog = threading.Thread(target=watch, daemon=True)
        watchdog.start()
        try:
            yield
        finally:
            over.set()
            watchdog.join()
            for _ in range(3):
                self._stand()
                time.sleep(0.02)

    def _due(self) -> Iterable[SensorReading]:
        """Return the readings of the ticks that are due."""
        inputs, new = self._inputs, self._latest - self._stepped
        if self._options.lockstep:
            due = new > 0.0 and inputs.complete(self._latest, self._images)
            return inputs.readings() if due else ()
        now = self._node.seconds()
        self._watch.tell_missing(now)
        if new > _ODD * self._period:
            return inputs.readings()
        alive = inputs.newest > self._stepped + self._period > -math.inf
        silent = alive and now - self._ticked > _SILENT
        return inputs.readings(inputs.newest) if silent else ()

    def _step(self, reading: SensorReading) -> Twist:
        if not self._options.lockstep:
            if self._halted:
                self._halted = False
                halt(self._stack)
            self._stack.period = min(reading.time - self._stepped, _MAX_PERIOD)
        self._stepped, self._ticked = reading.time, self._node.seconds()
        if self._held:
            self._halted = True
            self._stack.mofis.progress.reset()
        return self._stack.step(reading)

    def _stand(self) -> None:
        """Command the robot to stand, until the next tick."""
        # in lock step it waits for the command of its tick, as long as it takes
        if self._steers and not self._options.lockstep:
            self._halted = True
            self._send(_STAND)

    def _send(self, twist: Twist, at: float | None = None) -> None:
        stamp = self._node.now() if at is None else self._inputs.stamp_of(at)
        with self._sending:
            if self._stamped:
                self._command(command_message(twist, stamp))
            else:
                self._command(ros_message("geometry_msgs/msg/Twist", twist_fields(twist)))
            self._sent = self._node.seconds()
        if at is not None:
            state, still = self._stack.state, max(abs(twist.v), abs(twist.w)) <= _STILL
            belief = state.belief
            status = {
                "pose": None if belief is None else [belief.pose.x, belief.pose.y, belief.pose.yaw],
                "lost": belief is not None and belief.lost,
                "stamp": stamp,
                "goal": [self._goals[-1].x, self._goals[-1].y] if self._goals else None,
                "finished": state.finished,
                "still": still,
                "stuck": state.stuck,
                "fault": None if state.fault is None else state.fault.reason,
            }
            self._status(text_message(json.dumps(status)))

    def _ended(self) -> str:
        """Return how the drive has ended; "" while it goes on."""
        state = self._stack.state
        if state.fault is not None:
            return f"fault: {state.fault.reason}"
        if state.stuck:
            return f"stuck: {state.stuck}"
        twist = self._stack.verdict.twist
        still = max(abs(twist.v), abs(twist.w)) <= _STILL
        done = "reached" if self._goals else "no goal"
        return done if state.finished and still else ""
