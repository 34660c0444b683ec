"""A node of ROS 2 that sends and receives serialized messages; made only from rclpy.

Messages are read and written by the types of rosbags, as those of bags are.
"""

from __future__ import annotations

import importlib
import re
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from navfw.errors import ConfigError, InputError, UnknownNameError, did_you_mean
from navfw.recording import deserialize_cdr

Quality = Literal["sensor", "reliable", "latched"]
"""Quality of service: best effort as of sensor data, reliable, or kept for late subscribers."""

_DEPTH, _IMAGES, _MAX_TAKEN = 100, 5, 500
"""Messages that wait in a queue, images in one, and messages handled before ``spin`` returns."""
_PACED = 0.3
"""Wall time [s] over which the pace of a simulated clock is measured."""
_MAX_NOTES = 100
"""Largest number of notes: hostile messages could cause any number."""
_ROS_PARAMETERS = re.compile(r"use_sim_time|start_type_description_service|qos_overrides\..*")
"""Parameters that rclpy reads by itself."""


class RosNode:
    """A node called ``name``; ``arguments`` are the words after ``--ros-args``.

    Subscriptions are called by ``spin``, in the thread that calls it. ``notes`` are of topics whose
    types are not installed here, and of messages that cannot be read; ``declared`` are the
    parameters that were asked for.

    Raises:
        InputError: there is no rclpy, or ROS refuses the arguments.

    """

    def __init__(self, name: str, arguments: Sequence[str] = ()) -> None:
        rclpy = _module("rclpy")
        signals = importlib.import_module("rclpy.signals").SignalHandlerOptions.NO
        words = ["--ros-args", *arguments] if arguments else []
        try:
            rclpy.init(args=words, signal_handler_options=signals)
            made = importlib.import_module("rclpy.lifecycle").LifecycleNode
            self._node = made(
                name,
                automatically_declare_parameters_from_overrides=True,
                allow_undeclared_parameters=True,  # so that the node says why they are refused
            )
        except Exception as error:  # rclpy raises errors of many kinds
            rclpy.try_shutdown()
            reason = " ".join(str(error).split())[:200]
            raise InputError(f"ROS refuses to start a node: {reason}", key="--ros-args") from None
        self._rclpy = rclpy
        executors = importlib.import_module("rclpy.executors")
        self._ended = executors.TimeoutException, executors.ShutdownException
        self._executor = executors.SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.notes, self.declared = list[str](), list[str]()
        self._noted: set[str] = set()
        self._clock, self._pace = (0.0, 0.0), 1.0

    def parameter(self, name: str, default: Any) -> Any:
        """Return the parameter called ``name``, which must have the type of ``default``.

        Raises:
            ConfigError: it has another type.

        """
        self.declared.append(name)
        about = _module("rcl_interfaces.msg").ParameterDescriptor(dynamic_typing=True)
        if self._node.has_parameter(name):
            self._node.set_descriptor(name, about)
        else:
            self._node.declare_parameter(name, default, about)
        value = self._node.get_parameter(name).value
        if isinstance(default, float) and isinstance(value, int):
            value = float(value)
        if isinstance(default, list) and not isinstance(value, (str, bytes)):
            value = list(value)
        if type(value) is not type(default):
            what = f"is {value!r:.40}, expected {type(default).__name__}, e.g. {default!r}"
            raise ConfigError(f"the parameter {name} {what}", key="--ros-args")
        return value

    def check_parameters(self) -> None:
        """Check that all parameters which the node was started with have been asked for.

        Raises:
            UnknownNameError: one has not.

        """
        for name in self._node.get_parameters_by_prefix(""):
            if name not in self.declared and not _ROS_PARAMETERS.fullmatch(name):
                known = [*self.declared, "use_sim_time"]
                raise UnknownNameError("parameter", name, known, key="--ros-args")

    def serve_parameters(self, change: Callable[[Mapping[str, Any]], str]) -> None:
        """Have ``change`` take parameters that are set; it returns why not, or no text.

        Raises:
            UnknownNameError: the node was started with one that is not known.

        """
        self.check_parameters()
        result = _module("rcl_interfaces.msg").SetParametersResult

        def take(parameters: Sequence[Any]) -> Any:
            values = {parameter.name: parameter.value for parameter in parameters}
            other = next((name for name in values if not self._node.has_parameter(name)), None)
            if other is not None:
                known = did_you_mean(other, self.declared)
                reason = f"{other} cannot be changed while the node runs: {known}"
            else:
                reason = change(values)
            return result(successful=not reason, reason=reason)

        self._node.add_on_set_parameters_callback(take)

    def now(self) -> int:
        """Return the time of the node's clock [ns]: simulated with ``use_sim_time``."""
        return int(self._node.get_clock().now().nanoseconds)

    def seconds(self) -> float:
        """Return the time [s] by which silence is judged: the wall clock's, at the clock's pace.

        With ``use_sim_time`` a simulated clock that stands still is continued at its last pace, so
        that a slow simulation is not silent, and one that has ended is.
        """
        wall, (at, told) = time.monotonic(), self._clock
        return wall if told == 0.0 else told + self._pace * (wall - at)

    def _follow_clock(self) -> None:
        if not self._node.get_clock().ros_time_is_active:
            return
        now, wall, (at, told) = 1e-9 * self.now(), time.monotonic(), self._clock
        if told == 0.0 or now < told:
            self._clock = wall, now
        elif now > told and wall - at > _PACED:
            self._pace, self._clock = (now - told) / (wall - at), (wall, now)

    def publisher(
        self, topic: str, kind: str, quality: Quality = "reliable"
    ) -> Callable[[bytes], None]:
        """Return a function that publishes serialized messages of ``kind``, if installed."""
        message = self._kind(topic, kind)
        if message is None:
            return lambda _: None
        made = self._node.create_publisher(message, topic, self._quality(quality, kind))
        return lambda data: made.publish(data) if self._rclpy.ok() else None

    def resolved(self, topic: str) -> str:
        """Return the full name of ``topic``, as remapped."""
        return str(self._node.resolve_topic_name(topic))

    def wanted(self, topic: str) -> bool:
        """Return whether any node subscribes to ``topic``."""
        return bool(self._node.count_subscribers(self.resolved(topic)))

    def publishers(self, topic: str) -> int:
        """Return the number of nodes that publish ``topic``."""
        return int(self._node.count_publishers(self.resolved(topic)))

    def subscribe(
        self, topic: str, kind: str, receive: Callable[[Any], object], quality: Quality = "sensor"
    ) -> None:
        """Call ``receive`` with every message of ``topic`` that can be read."""
        message = self._kind(topic, kind)

        def take(data: bytes) -> None:
            try:
                read = deserialize_cdr(data, kind)
            except Exception:  # rosbags raises errors of many kinds for damaged content
                self.note(f"a message on {topic} cannot be read")
                return
            receive(read)

        if message is not None:
            profile = self._quality(quality, kind)
            if quality == "latched":
                profile.depth = _DEPTH  # several nodes may have kept one message each
            self._node.create_subscription(message, topic, take, profile, raw=True)

    def serve(self, name: str, answer: Callable[[], str]) -> None:
        """Offer a service ``std_srvs/Trigger`` that responds with the text of ``answer()``."""
        trigger = _module("std_srvs.srv").Trigger

        def serve(_: Any, response: Any) -> Any:
            response.success, response.message = True, answer()
            return response

        self._node.create_service(trigger, f"~/{name}", serve)

    def serve_action(
        self, name: str, kind: str, begin: Callable[[Any], bool], cancel: Callable[[], object]
    ) -> Callable[[bool], None]:
        """Offer an action if its type is installed; ``begin`` returns whether it takes a goal.

        The function returned ends the goals that were taken: with success, or without.
        """
        action = self._kind(name, kind)
        if action is None:
            return lambda _: None
        server, future = importlib.import_module("rclpy.action"), self._rclpy.task.Future
        waiting = list[Any]()

        def end(success: bool) -> None:
            while waiting:
                waiting.pop().set_result(success)

        def take(goal: Any) -> Any:
            return server.GoalResponse.ACCEPT if begin(goal) else server.GoalResponse.REJECT

        def give_up(_: Any) -> Any:
            cancel()
            return server.CancelResponse.ACCEPT

        async def execute(goal: Any) -> Any:
            waiting.append(future())
            success = await waiting[-1]
            ended = goal.succeed if success else goal.abort
            (goal.canceled if goal.is_cancel_requested else ended)()
            return action.Result()

        server.ActionServer(
            self._node, action, name, execute, goal_callback=take, cancel_callback=give_up
        )
        return end

    def manage(self, activate: Callable[[], object], deactivate: Callable[[], object]) -> None:
        """Let a lifecycle manager deactivate and activate the node, which is active from now on."""
        lifecycle = importlib.import_module("rclpy.lifecycle")

        class Managed(lifecycle.ManagedEntity):  # type: ignore[misc, name-defined]
            def on_activate(self, _: Any) -> Any:
                activate()
                return lifecycle.TransitionCallbackReturn.SUCCESS

            def on_deactivate(self, _: Any) -> Any:
                deactivate()
                return lifecycle.TransitionCallbackReturn.SUCCESS

            on_shutdown = on_error = on_deactivate

        self._node.add_managed_entity(Managed())
        self._node.trigger_configure()
        self._node.trigger_activate()

    def spin(self, seconds: float) -> None:
        """Handle all messages that have arrived; wait up to ``seconds`` for the first one."""
        for number in range(_MAX_TAKEN):
            try:
                wait = seconds if number == 0 else 0.0
                callback, *_ = self._executor.wait_for_ready_callbacks(timeout_sec=wait)
            except self._ended:
                return
            callback()
            callback.result()
            self._follow_clock()

    def spin_for(self, seconds: float) -> None:
        """Handle all messages that arrive within ``seconds`` of wall-clock time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.spin(left)

    def note(self, text: str) -> None:
        """Log ``text`` as a warning, and add it to ``notes``, once, whatever its numbers are."""
        kind = re.sub(r"[-+.\d]+", "", text)
        if kind not in self._noted and len(self.notes) < _MAX_NOTES:
            self._noted.add(kind)
            self.notes.append(text)
            self._node.get_logger().warning(text)

    def say(self, text: str) -> None:
        """Log a line for people."""
        self._node.get_logger().info(text)

    def close(self) -> None:
        """Leave the graph of nodes."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._rclpy.try_shutdown()

    def has_type(self, kind: str) -> bool:
        """Return whether messages of ``kind`` can be sent here."""
        return self._kind("", kind) is not None

    def _kind(self, topic: str, kind: str) -> Any:
        package, group, name = kind.split("/")
        try:
            return getattr(importlib.import_module(f"{package}.{group}"), name)
        except ImportError:
            if topic:
                self.note(f"{topic} is left out: {package} is not installed")
            return None

    def _quality(self, quality: Quality, kind: str) -> Any:
        qos = importlib.import_module("rclpy.qos")
        reliable = qos.ReliabilityPolicy.RELIABLE
        effort = qos.ReliabilityPolicy.BEST_EFFORT if quality == "sensor" else reliable
        local = qos.DurabilityPolicy.TRANSIENT_LOCAL
        kept = local if quality == "latched" else qos.DurabilityPolicy.VOLATILE
        depth = 1 if quality == "latched" else _IMAGES if kind.endswith("Image") else _DEPTH
        return qos.QoSProfile(depth=depth, reliability=effort, durability=kept)


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        how = "source the setup of a ROS 2 distribution (Jazzy, Kilted), and use a virtual"
        how += " environment with --system-site-packages"
        what = f"there is no {name.split('.', maxsplit=1)[0]}: {how}"
        raise InputError(what) from None
