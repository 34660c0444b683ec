"""Processes of ``navfw ros`` over loopback, and a node that listens to them; needs rclpy."""

import random
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cli_calls import PROGRAM

from navfw.ros import RosNode

DRIVE = ("drive", "--map", "empty", "--start", "0,0,0", "--goal", "3,0", "--tolerance", "0.4")
SIM = ("sim", "empty", "straight", "--seed", "1")
# waits for a driver that starts slowly
PATIENT = (*SIM, "--set", "mission.timeout=600", "--set", "mission.stuck_after=600")
SIM_TIME = ("--ros-args", "-p", "use_sim_time:=true")


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain of ROS of this test's own, on loopback."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(random.SystemRandom().randint(1, 100)))


@contextmanager
def started(folder: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    """A process of ``navfw ros``; its output goes to files called by its first word."""
    with (
        (folder / f"{words[0]}.json").open("w") as out,
        (folder / f"{words[0]}.err").open("w") as err,
    ):
        command = [sys.executable, "-c", PROGRAM, "ros", *words]
        process = subprocess.Popen(command, stdout=out, stderr=err, text=True)  # noqa: S603
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def said(folder: Path, word: str) -> str:
    return (folder / f"{word}.err").read_text()


def wait_until(condition: Any, seconds: float = 60.0, pause: Any = time.sleep) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        pause(0.02)


class Listener:
    """A node that keeps the newest message of each topic, and when it came."""

    def __init__(self) -> None:
        self.node = RosNode("listener")
        self.newest: dict[str, Any] = {}
        for topic, kind in (
            ("cmd_vel", "geometry_msgs/msg/TwistStamped"),
            ("/ground_truth/odom", "nav_msgs/msg/Odometry"),
            ("navfw/local_map", "nav_msgs/msg/OccupancyGrid"),
            ("navfw/explanation", "std_msgs/msg/String"),
            ("navfw/image/compressed", "sensor_msgs/msg/CompressedImage"),
            ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
            ("navfw/path", "nav_msgs/msg/Path"),
        ):
            self.node.subscribe(topic, kind, self._keep(topic))
        # as Nav2 and tf listen
        self.node.subscribe("odom", "nav_msgs/msg/Odometry", self._keep("odom"), "reliable")

    def _keep(self, topic: str) -> Any:
        def keep(message: Any) -> None:
            self.newest[topic] = message

        return keep

    @property
    def x(self) -> float:
        """Where the simulated robot truly is."""
        message = self.newest.get("/ground_truth/odom")
        return 0.0 if message is None else float(message.pose.pose.position.x)

    @property
    def speed(self) -> float:
        message = self.newest.get("cmd_vel")
        return 0.0 if message is None else float(message.twist.linear.x)

    def spin_until(self, condition: Any, seconds: float = 60.0) -> None:
        wait_until(condition, seconds, self.node.spin)


@pytest.fixture
def listener(domain: None) -> Iterator[Listener]:
    made = Listener()
    yield made
    made.node.close()
