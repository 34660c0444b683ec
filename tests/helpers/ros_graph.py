"""A graph of ROS 2 inside one process and in simulated time: messages may be late, or get lost."""

import heapq
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from navfw.missions import MissionLoop, MissionResult, prepare
from navfw.plugins import default_registry
from navfw.recording import deserialize_cdr
from navfw.ros import DriveNode, DriveOptions, RosNode, RosPilot
from navfw.ros.map_keeper import MapKeeper
from navfw.signals import Pose
from navfw.stack import MappingStack, Stack

STEP = 0.004
"""Time [s] in which the graph advances."""


@dataclass
class Graph:
    """All topics and the clock [s].

    A share ``dropped`` of the messages is lost, the others take up to ``jitter`` [s], those of a
    topic in their order; commands are not lost. ``spoil`` may change a message, or return several.
    """

    dropped: float = 0.0
    jitter: float = 0.0
    seed: int = 0
    spoil: Callable[[str, bytes], Sequence[bytes]] = lambda _, data: [data]
    time: float = 0.0
    topics: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    sent: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)
        self._queue: list[tuple[float, int, Any, bytes]] = []
        self._number = count()
        self._due: dict[str, float] = {}

    def monotonic(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    def send(self, topic: str, data: bytes) -> None:
        self.sent[topic] = data
        for content in self.spoil(topic, data):
            if topic != "cmd_vel" and self._random.random() < self.dropped:
                continue
            due = max(self.time + self.jitter * self._random.random(), self._due.get(topic, 0.0))
            self._due[topic] = due
            for take in self.topics[topic]:
                heapq.heappush(self._queue, (due, next(self._number), take, content))

    def deliver(self) -> None:
        while self._queue and self._queue[0][0] <= self.time:
            *_, take, data = heapq.heappop(self._queue)
            take(data)


class GraphNode:
    """A ``RosNode`` of that graph; time passes while the simulated robot waits in ``spin_for``."""

    def __init__(self, graph: Graph, **parameters: Any) -> None:
        self.graph, self.parameters = graph, parameters
        self.notes: list[str] = []
        self.declared: list[str] = []
        self.services: dict[str, Callable[[], str]] = {}
        self.action_ends: list[bool] = []
        self.meanwhile: Callable[[], object] = lambda: None

    def parameter(self, name: str, default: Any) -> Any:
        self.declared.append(name)
        return self.parameters.get(name, default)

    def check_parameters(self) -> None:
        pass

    def serve_parameters(self, change: Callable[[Mapping[str, Any]], str]) -> None:
        self.change = change

    def now(self) -> int:
        return round(1e9 * self.graph.time)

    def seconds(self) -> float:
        return self.graph.time

    def publisher(self, topic: str, _kind: str, _quality: str = "") -> Callable[[bytes], None]:
        return lambda data: self.graph.send(topic, data)

    def subscribe(self, topic: str, kind: str, receive: Any, _quality: str = "") -> None:
        def take(data: bytes) -> None:
            try:
                message = deserialize_cdr(data, kind)
            except Exception:  # as RosNode
                self.note(f"a message on {topic} cannot be read")
                return
            receive(message)

        self.graph.topics[topic].append(take)

    def serve(self, name: str, answer: Callable[[], str]) -> None:
        self.services[name] = answer

    def serve_action(self, _name: str, _kind: str, begin: Any, cancel: Any) -> Any:
        self.begin, self.cancel = begin, cancel
        return self.action_ends.append

    def manage(self, *_: Callable[[], object]) -> None:
        pass

    def resolved(self, topic: str) -> str:
        return topic

    def wanted(self, topic: str) -> bool:
        return bool(self.graph.topics[topic])

    def publishers(self, _topic: str) -> int:
        return 1

    def has_type(self, _kind: str) -> bool:
        return True

    def spin(self, _seconds: float) -> None:
        self.graph.deliver()

    def spin_for(self, seconds: float) -> None:
        end = self.graph.time + seconds
        while self.graph.time < end:
            self.graph.time = min(self.graph.time + STEP, end)
            self.meanwhile()

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    say = note


@dataclass
class GraphDrive:
    """A mission whose robot and driver are nodes of ``graph``; without one an exploration.

    With ``keep`` the driver keeps its map in this file, and if it ``watches`` it does nothing else.
    """

    graph: Graph
    monkeypatch: pytest.MonkeyPatch
    world: str
    mission: str | None
    seed: int = 1
    settings: Sequence[str] = ()
    parameters: dict[str, Any] = field(default_factory=dict)
    each: Callable[["GraphDrive"], object] = lambda _: None
    """Called at every step of the graph."""
    keep: Path | None = None
    watches: bool = False

    def __post_init__(self) -> None:
        for module in ("drive_node", "robot_node"):
            self.monkeypatch.setattr(f"navfw.ros.{module}.time", self.graph)
        self.ended = ""
        self.session = prepare(self.world, self.mission, seed=self.seed, overrides=self.settings)
        self.node = GraphNode(self.graph, **self.parameters)
        self.robot_node = GraphNode(self.graph)
        task, node = self.session.task, cast("RosNode", self.node)
        self.stack: Stack = self.session.stack
        goals = task.goals
        if self.watches:
            mapper, nothing = MappingStack.load, self.session.mission.topo_map
            self.stack, goals = mapper("explore", task.robot, nothing, default_registry()), ()
        options = DriveOptions(task.start if task.start_known else None, goals, once=True)
        self.keeper = None if self.keep is None else MapKeeper(node, self.stack, self.keep)
        self.driver = DriveNode(node, self.stack, options, self.keeper)

    def run(self) -> MissionResult:
        simulation = self.session.simulation()
        try:
            self.robot_node.meanwhile = self._step
            self._true_pose = simulation.true_pose
            task = self.session.task
            pilot = RosPilot(cast("RosNode", self.robot_node), task.robot, simulation)
            self.driver.begin()
            drive = MissionLoop(task, pilot, simulation).run()
            return MissionResult.of(self.session, drive, simulation)
        finally:
            simulation.close()

    def _step(self) -> None:
        self.ended = self.driver.advance(0.0) or self.ended
        self.each(self)

    @property
    def truth(self) -> Pose:
        """Where the robot truly is."""
        return self._true_pose()

    @property
    def speed(self) -> float:
        """The speed [m/s] that was commanded last."""
        if "cmd_vel" not in self.graph.sent:
            return 0.0
        kind = "geometry_msgs/msg/TwistStamped"
        return float(deserialize_cdr(self.graph.sent["cmd_vel"], kind).twist.linear.x)
