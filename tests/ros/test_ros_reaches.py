"""Drives in real time: simulated robot and driving node as two processes over loopback.

By request: ``make test-ros PYTEST_OPTIONS="-s -m slow tests/ros/test_ros_reaches.py"``, where
nothing else runs. Each drive is printed as a line of JSON.
"""

import heapq
import json
import resource
import sys
import time
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs the group ros: make test-ros")

from drawn_plans import PLANS
from rclpy.qos import qos_profile_sensor_data
from ros_processes import (
    DRIVE,
    PATIENT,
    SIM_TIME,
    Listener,
    domain,
    listener,
    said,
    started,
    wait_until,
)
from sensor_msgs import msg

from navfw.missions import prepare
from navfw.recording import code_revision, machine_kind
from navfw.ros import RosNode
from navfw.worldgen import generate
from navfw.worldgen.plan_exchange import import_plan

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("domain")]

__all__ = ["domain", "listener"]
SENSORS = {"image": msg.Image, "imu": msg.Imu, "joint_states": msg.JointState}


class Relay:
    """Loses a share of the messages of the sensors, and delays the others, in their order."""

    def __init__(self, seed: int, dropped: float = 0.1, jitter: float = 0.05) -> None:
        self._node, self._random = RosNode("relay"), np.random.default_rng(seed)
        self._dropped, self._jitter = dropped, jitter
        self._queue: list[tuple[float, int, Any, Any]] = []
        self._number, self._due = count(), dict.fromkeys(SENSORS, 0.0)
        for topic, kind in SENSORS.items():
            send = self._node.publisher(topic, f"sensor_msgs/msg/{kind.__name__}", "sensor")
            take = self._taker(topic, send)
            graph = self._node._node
            graph.create_subscription(kind, f"raw/{topic}", take, qos_profile_sensor_data, raw=True)

    def _taker(self, topic: str, send: Any) -> Callable[[bytes], None]:
        def take(message: bytes) -> None:
            if self._random.random() < self._dropped:
                return
            due = time.monotonic() + self._jitter * self._random.random()
            self._due[topic] = max(self._due[topic], due)
            heapq.heappush(self._queue, (self._due[topic], next(self._number), send, message))

        return take

    def spin(self) -> None:
        self._node.spin(0.002)
        while self._queue and self._queue[0][0] <= time.monotonic():
            *_, send, data = heapq.heappop(self._queue)
            send(data)

    def close(self) -> None:
        self._node.close()


def tell(row: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(row) + "\n")
    sys.stdout.flush()


def driven(
    folder: Path, world: str, mission: str, seed: int, *, relayed: bool = False
) -> dict[str, Any]:
    """What the simulated robot and the driving node say at the end of a mission in real time."""
    task = prepare(world, mission, seed=seed).task
    assert task.start is not None
    start = ",".join(repr(value) for value in (task.start.x, task.start.y, task.start.yaw))
    places = [goal.place or f"{goal.x!r},{goal.y!r}" for goal in task.goals]
    goals = [word for place in places for word in ("--goal", place)]
    known = Path(world).parent / "map.yaml"
    about = ("--map", str(known) if known.is_file() else world, "--start", start, *goals)
    relayed_to = [word for topic in SENSORS for word in ("-r", f"{topic}:=raw/{topic}")]
    relay = Relay(seed) if relayed else None
    drive = ("drive", *about, "--tolerance", repr(task.goals[0].tolerance), "--json")
    sim = ("sim", world, mission, "--seed", str(seed), "--json")
    with started(folder, *drive, *SIM_TIME) as driver:
        wait_until(lambda: " on the map " in said(folder, "drive"), 200.0)
        words = (*sim, "--ros-args", *relayed_to) if relayed else sim
        with started(folder, *words) as robot:
            while robot.poll() is None:
                relay.spin() if relay else time.sleep(0.05)
        if relay:
            relay.close()
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        driver.terminate()
        driver.wait(10.0)
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = json.loads((folder / "sim.json").read_text())
    own = json.loads((folder / "drive.json").read_text() or "{}")
    keys = "outcome", "reason", "sim_time_s", "wall_time_s", "collision_cause"
    return {
        "world": Path(world).parent.name or world,
        "seed": seed,
        **{key: told.get(key) for key in keys},
        "ended": own.get("ended"),
        "p50": own.get("latency_p50_ms"),
        "p99": own.get("latency_p99_ms"),
        "cpu": round(usage.ru_utime - before.ru_utime + usage.ru_stime - before.ru_stime, 1),
        "notes": own.get("notes"),
    }


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Drives in numbers: latencies [ms], and the node's processor time over the driven time."""
    outcomes = [row["outcome"] for row in rows]
    seconds = sum(row["wall_time_s"] for row in rows)
    return {
        "drives": len(rows),
        "reached": outcomes.count("reached"),
        "collided": outcomes.count("collided"),
        "latency_p50_ms": float(np.median([row["p50"] for row in rows])),
        "latency_p99_ms": float(np.median([row["p99"] for row in rows])),
        "latency_p99_max_ms": float(max(row["p99"] for row in rows)),
        "processor_share": sum(row["cpu"] for row in rows) / seconds,
    }


def keep(name: str, values: dict[str, Any]) -> None:
    """Add values to runs/ros.json, in the form of ``navfw bench``, for ``navfw results add``."""
    file = Path("runs") / "ros.json"
    file.parent.mkdir(exist_ok=True)
    kept = json.loads(file.read_text()) if file.exists() else {}
    command = f"make test-ros PYTEST_OPTIONS='-m slow {Path(__file__).name}'"
    about = {"seeds": "", "revision": code_revision(), "machine": machine_kind()}
    file.write_text(json.dumps({**kept, name: values, "provenance": {"command": command, **about}}))


def table(
    folder: Path, name: str, drives: Sequence[tuple[str, str, int]], *, relayed: bool = False
) -> int:
    """How many of the drives arrive; none may touch anything by the robot's own motion."""
    rows = []
    for number, drive in enumerate(drives):
        (own := folder / str(number)).mkdir()
        rows.append(driven(own, *drive, relayed=relayed))
        tell(rows[-1])
    values = summary(rows)
    keep(name, values)
    assert values["collided"] == 0
    return int(values["reached"])


OFFICE = [("office", "lobby-to-lab", seed) for seed in range(10)]


def test_the_office(tmp_path: Path) -> None:
    assert table(tmp_path, "office", OFFICE) >= 9


def test_the_office_with_late_and_lost_messages(tmp_path: Path) -> None:
    assert table(tmp_path, "late_and_lost", OFFICE, relayed=True) >= 8


def test_rooms(tmp_path: Path) -> None:
    drives = []
    for seed in range(9100, 9120):
        folder = generate("rooms", seed).write(tmp_path / f"rooms-{seed}")
        drives.append((str(folder / "world.yaml"), "cross", seed))
    assert table(tmp_path, "rooms", drives) >= 18


def test_plans_of_a_person(tmp_path: Path) -> None:
    drives = []
    for name, plan in PLANS.items():
        made = import_plan(plan(), name)
        longest = max(made.lengths, key=made.lengths.__getitem__)
        drives.append((str(made.write(tmp_path / name) / "world.yaml"), longest, 0))
    assert table(tmp_path, "plans", drives) == len(drives)


def test_a_driver_killed_at_any_moment_leaves_the_robot_standing(
    tmp_path: Path, listener: Listener
) -> None:
    random, stood = np.random.default_rng(7), list[float]()
    for number in range(20):
        (folder := tmp_path / str(number)).mkdir()
        with started(folder, *DRIVE, *SIM_TIME) as driver, started(folder, *PATIENT):
            listener.spin_until(lambda: listener.speed > 0.1, 200.0)
            listener.node.spin_for(float(random.uniform(0.0, 4.0)))
            driver.kill()
            killed, x, moved = time.monotonic(), listener.x, 0.0
            while time.monotonic() < killed + 1.5:
                listener.node.spin(0.01)
                if abs(listener.x - x) > 5e-4:
                    x, moved = listener.x, time.monotonic() - killed
        listener.newest.clear()
        stood.append(moved)
        tell({"killed": number, "stood_after_s": round(moved, 3)})
    keep("killed", {"kills": len(stood), "stood_after_max_s": max(stood)})
    assert max(stood) <= 0.5
