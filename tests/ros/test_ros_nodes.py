"""Nodes of ROS 2 over loopback: the stack drives the simulated robot; each survives the other."""

import json
import signal
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import navfw
from navfw.recording import ros_message
from navfw.ros.connection import Quality
from navfw.topomap import load_map

pytest.importorskip("rclpy", reason="needs the group ros: make test-ros")

from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from ros_processes import (
    DRIVE,
    PATIENT,
    SIM,
    SIM_TIME,
    Listener,
    domain,
    listener,
    said,
    started,
    wait_until,
)
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

__all__ = ["domain", "listener"]


@pytest.mark.usefixtures("domain")
def test_in_lock_step_the_commands_are_those_of_navfw_run(tmp_path: Path) -> None:
    with ExitStack() as processes:
        drive = (*DRIVE, "--lockstep", "--json", *SIM_TIME)
        driver = processes.enter_context(started(tmp_path, *drive))
        robot = processes.enter_context(started(tmp_path, *SIM, "--pace", "0", "--json"))
        assert robot.wait(200.0) == 0, said(tmp_path, "sim")
        assert driver.wait(20.0) == 0, said(tmp_path, "drive")
    result = json.loads((tmp_path / "sim.json").read_text())
    alone = navfw.run("empty", "straight", seed=1, stack="default")
    assert result["command_hash"] == alone.log.command_hash
    assert json.loads((tmp_path / "drive.json").read_text())["ended"] == "reached"


@pytest.mark.thorough
@pytest.mark.usefixtures("domain")
def test_two_robots_on_a_graph_go_to_goals_of_their_own_in_lock_step(tmp_path: Path) -> None:
    with ExitStack() as processes:
        drivers = []
        for name, goal in (("one", "2,0"), ("two", "1.5,0.5")):
            (folder := tmp_path / name).mkdir()
            start = "--start", "0,0,0", "--namespace", name
            robot = "sim", "empty", *start, "--pace", "0"
            drive = "drive", "--map", "empty", *start, "--goal", goal, "--lockstep", "--json"
            processes.enter_context(started(folder, *robot))
            drivers.append(processes.enter_context(started(folder, *drive, *SIM_TIME)))
        assert [driver.wait(200.0) for driver in drivers] == [0, 0]
    for folder in tmp_path.iterdir():
        told = json.loads((folder / "drive.json").read_text())
        assert told["ended"] == "reached"
        assert not any("nodes publish" in note for note in told["notes"])


EXPLORED = ("paper-room", "--explore", "--seed", "1", "--set", "mission.explore.limit=35")
EXPLORE = ("explore", "--start", "0.9,0.9,0.3", "--limit", "35", "--out-map")


@pytest.mark.thorough
@pytest.mark.usefixtures("domain")
def test_in_lock_step_the_map_is_that_of_navfw_run(tmp_path: Path) -> None:
    file = tmp_path / "made.yaml"
    with ExitStack() as processes:
        driver = processes.enter_context(
            started(tmp_path, *EXPLORE, str(file), "--lockstep", "--json", *SIM_TIME)
        )
        robot = processes.enter_context(
            started(tmp_path, "sim", *EXPLORED, "--pace", "0", "--json")
        )
        assert robot.wait(200.0) == 0, said(tmp_path, "sim")
        assert driver.wait(20.0) == 0, said(tmp_path, "explore")
    alone = navfw.run("paper-room", None, seed=1, set={"mission.explore.limit": 35})
    result = json.loads((tmp_path / "sim.json").read_text())
    assert result["command_hash"] == alone.log.command_hash
    assert json.loads((tmp_path / "explore.json").read_text())["map"] == str(file)
    made, reference = load_map(file), alone.explored_map("made")
    assert made.places == reference.places
    assert made.floor_plan is not None
    assert reference.floor_plan is not None
    assert np.array_equal(made.floor_plan.cells, reference.floor_plan.cells)


def test_a_killed_explorer_leaves_its_map(tmp_path: Path, listener: Listener) -> None:
    file, kind = tmp_path / "made.yaml", "nav_msgs/msg/OccupancyGrid"
    with ExitStack() as processes:
        driver = processes.enter_context(started(tmp_path, *EXPLORE, str(file), *SIM_TIME))
        waits = "--set", "mission.stuck_after=600", "--set", "mission.timeout=600"
        processes.enter_context(started(tmp_path, "sim", *EXPLORED, *waits))
        listener.spin_until(file.exists, 200.0)
        late = list[Any]()  # the grid is kept for who comes late
        listener.node.subscribe("navfw/map", kind, late.append, "latched")
        listener.spin_until(lambda: late, 5.0)
        assert {-1, 0} <= set(late[-1].data) <= {-1, 0, 100}
        driver.send_signal(signal.SIGKILL)
        driver.wait(10.0)
    topo_map = load_map(file)
    assert topo_map.floor_plan is not None
    assert topo_map.floor_plan.free.sum() > 100
    assert driver.returncode == -signal.SIGKILL


@pytest.mark.thorough
def test_a_person_teaches_a_map_with_another_node(tmp_path: Path, listener: Listener) -> None:
    file = tmp_path / "taught.yaml"
    steer = listener.node.publisher("cmd_vel", "geometry_msgs/msg/TwistStamped")
    name = listener.node.publisher("name_place", "std_msgs/msg/String")
    at = {"frame_id": "base_link"}
    ahead = {"header": at, "twist": {"linear": {"x": 0.3}, "angular": {"z": 0.15}}}

    def driven() -> bool:
        steer(ros_message("geometry_msgs/msg/TwistStamped", ahead))
        listener.node.spin_for(0.05)
        return listener.x > 1.5

    with ExitStack() as processes:
        words = "drive", "--teach", str(file), "--start", "0,0,0", *SIM_TIME
        driver = processes.enter_context(started(tmp_path, *words))
        processes.enter_context(started(tmp_path, *PATIENT))
        listener.spin_until(lambda: listener.node.wanted("name_place"), 200.0)
        listener.spin_until(lambda: "/ground_truth/odom" in listener.newest, 60.0)
        assert listener.node._node.count_publishers("/cmd_vel") == 1  # the listener's own
        wait_until(driven, 60.0, lambda _: None)
        name(ros_message("std_msgs/msg/String", {"data": "dock"}))
        wait_until(lambda: "dock is at" in said(tmp_path, "drive"), 5.0)
        driver.send_signal(signal.SIGTERM)
        assert driver.wait(20.0) == 0, said(tmp_path, "drive")
    assert "dock" in load_map(file).places


def test_a_killed_driver_leaves_the_robot_standing_and_tells_what_it_sees(
    tmp_path: Path, listener: Listener
) -> None:
    with ExitStack() as processes:
        driver = processes.enter_context(started(tmp_path, *DRIVE, *SIM_TIME))
        processes.enter_context(started(tmp_path, *PATIENT))
        listener.spin_until(lambda: listener.speed > 0.2 and listener.x > 0.3, 200.0)
        views = {"navfw/local_map", "navfw/explanation", "navfw/path", "navfw/image/compressed"}
        listener.spin_until(lambda: views | {"odom"} <= set(listener.newest), 3.0)
        assert json.loads(listener.newest["navfw/explanation"].data)
        assert bytes(listener.newest["navfw/image/compressed"].data[:2]) == b"\xff\xd8"
        driver.send_signal(signal.SIGKILL)
        listener.node.spin_for(0.7)
        stood_at = listener.x
        listener.node.spin_for(0.5)
        assert listener.x == pytest.approx(stood_at, abs=0.01)


@pytest.mark.thorough
def test_a_driver_without_its_robot_says_so_and_drives_on_when_it_is_back(
    tmp_path: Path, listener: Listener
) -> None:
    with ExitStack() as processes:
        driver = processes.enter_context(started(tmp_path, *DRIVE, *SIM_TIME))
        robot = processes.enter_context(started(tmp_path, *PATIENT))
        listener.spin_until(lambda: listener.speed > 0.2, 200.0)
        robot.send_signal(signal.SIGKILL)
        wait_until(
            lambda: "nothing comes on image, imu, joint_states" in said(tmp_path, "drive"), 3.0
        )
        listener.spin_until(lambda: listener.speed == 0.0, 1.0)
        (tmp_path / "sim.err").unlink()
        processes.enter_context(started(tmp_path, *PATIENT))
        listener.spin_until(lambda: listener.speed > 0.2, 200.0)
        driver.send_signal(signal.SIGTERM)
        driver.wait(10.0)
        listener.spin_until(lambda: listener.speed == 0.0, 2.0)
        assert "Traceback" not in said(tmp_path, "drive")


def call(listener: Listener, kind: Any, name: str, request: Any) -> Any:
    """Call a service of the driver; its answer."""
    client = listener.node._node.create_client(kind, f"/navfw/{name}")
    listener.spin_until(client.service_is_ready)
    answer = client.call_async(request)
    listener.spin_until(answer.done)
    return answer.result()


def test_services_parameters_and_a_lifecycle_manager_act_on_the_driver(
    tmp_path: Path, listener: Listener
) -> None:
    def stands() -> None:
        listener.spin_until(lambda: listener.speed == 0.0, 2.0)
        listener.node.spin_for(1.0)
        assert listener.speed == 0.0

    def change(number: int) -> None:
        transition = Transition(id=number)
        answer = call(
            listener, ChangeState, "change_state", ChangeState.Request(transition=transition)
        )
        assert answer.success

    with ExitStack() as processes:
        processes.enter_context(started(tmp_path, *DRIVE, *SIM_TIME))
        processes.enter_context(started(tmp_path, *PATIENT, "--pace", "0.5"))
        listener.spin_until(lambda: listener.speed > 0.1, 200.0)
        client = AsyncParameterClient(listener.node._node, "/navfw")
        for name, value, reason in (
            ("avoid.weight", 1, ""),
            ("avoid.wieght", 1.0, "did you mean 'avoid.weight'?"),
            ("wheels", "odom", "read when the node starts"),
        ):
            listener.spin_until(client.services_are_ready)
            answer = client.set_parameters([Parameter(name, value=value)])
            listener.spin_until(answer.done)
            result = answer.result().results[0]
            assert result.successful == (not reason)
            assert reason in result.reason
        change(Transition.TRANSITION_DEACTIVATE)
        stands()
        assert "stands" in call(listener, Trigger, "stop", Trigger.Request()).message
        change(Transition.TRANSITION_ACTIVATE)
        stands()
        assert "driving on" in call(listener, Trigger, "resume", Trigger.Request()).message
        listener.spin_until(lambda: listener.speed > 0.1, 10.0)
        assert "dropped" in call(listener, Trigger, "cancel", Trigger.Request()).message
        stands()


def test_senses_beside_any_driver_of_a_robot_without_a_mission(
    tmp_path: Path, listener: Listener
) -> None:
    heard, images = list[Any](), dict[str, int]()
    qualities: tuple[Quality, ...] = ("reliable", "sensor")
    steer = listener.node.publisher("robot/cmd_vel", "geometry_msgs/msg/TwistStamped")
    listener.node.subscribe("robot/navfw/scan", "sensor_msgs/msg/LaserScan", heard.append)
    for quality in qualities:

        def count(_: Any, quality: str = quality) -> None:
            images[quality] = images.get(quality, 0) + 1

        listener.node.subscribe("robot/image", "sensor_msgs/msg/Image", count, quality)
    at, ahead = {"frame_id": "base_link"}, {"linear": {"x": 0.3}}
    command = ros_message("geometry_msgs/msg/TwistStamped", {"header": at, "twist": ahead})

    def seen() -> bool:
        steer(command)
        listener.node.spin_for(0.05)
        return len(heard) > 20 and bool(np.isfinite(heard[-1].ranges).any())

    own = "--namespace", "robot"
    with ExitStack() as processes:
        sensing = processes.enter_context(started(tmp_path, "sense", *own, *SIM_TIME))
        slow = "sim", "paper-room", "--start", "0.9,0.9,0.3", "--pace", "0.7"
        robot = processes.enter_context(started(tmp_path, *slow, *own))
        wait_until(seen, 200.0, lambda _: None)
        assert heard[-1].header.frame_id == "base_link"
        assert set(images) == {"reliable", "sensor"}
        assert "navfw/status" not in dict(listener.node._node.get_topic_names_and_types())
        client = listener.node._node.create_client(Trigger, "/robot/navfw_sim/reset")
        listener.spin_until(client.service_is_ready)
        before, answer = heard[-1].header.stamp.sec, client.call_async(Trigger.Request())
        listener.spin_until(answer.done)
        listener.spin_until(lambda: heard[-1].header.stamp.sec < before)
        for process in (sensing, robot):
            process.send_signal(signal.SIGTERM)
            assert process.wait(20.0) == 0, said(tmp_path, "sense")
    assert "silent" not in said(tmp_path, "sense")


def test_goals_of_an_action_succeed_fail_and_are_cancelled(listener: Listener) -> None:
    node, begun = listener.node, list[int]()

    def begin(goal: Any) -> bool:
        begun.append(goal.order)
        return bool(goal.order > 0)

    # stands in for NavigateToPose, whose wheels there are not
    end = node.serve_action("~/count", "test_msgs/action/Fibonacci", begin, lambda: end(False))
    client = ActionClient(node._node, Fibonacci, "~/count")
    listener.spin_until(client.server_is_ready)
    ended = []
    for order in (0, 1, 2, 3):
        sent = client.send_goal_async(Fibonacci.Goal(order=order))
        listener.spin_until(sent.done)
        assert sent.result().accepted == (order > 0)
        if order == 0:
            continue
        result = sent.result().get_result_async()
        listener.node.spin_for(0.3)
        assert not result.done()
        if order == 3:
            sent.result().cancel_goal_async()
        else:
            end(order == 1)
        listener.spin_until(result.done)
        ended.append(result.result().status)
    assert begun == [0, 1, 2, 3]
    status = GoalStatus
    assert ended == [status.STATUS_SUCCEEDED, status.STATUS_ABORTED, status.STATUS_CANCELED]
    node.serve_action("~/x", "nav2_msgs/action/NavigateToPose", begin, node.close)(True)
    assert any("nav2_msgs is not installed" in note for note in node.notes)


def test_wrong_words_end_with_2_before_ros_starts(tmp_path: Path) -> None:
    for words in (
        ("drive", "--map", "empty", "--goal", "nowhere"),
        ("drive", "--map", "empty", "--start", "1,2"),
        ("sim", "nowhere"),
    ):
        with started(tmp_path, *words) as process:
            assert process.wait(60.0) == 2
        assert "navfw: " in said(tmp_path, words[0])


@pytest.mark.usefixtures("domain")
def test_parameters_that_are_not_known_end_with_2(tmp_path: Path) -> None:
    for words, name, remedy in (
        (("drive", "--map", "empty"), "avoid.wieght", "did you mean 'avoid.weight'?"),
        (("sense",), "publsh_tf", "did you mean 'publish_tf'?"),
        (("sim", "empty"), "wheels", "known: use_sim_time"),
    ):
        with started(tmp_path, *words, *SIM_TIME, "-p", f"{name}:=1") as process:
            assert process.wait(200.0) == 2
        told = " ".join(said(tmp_path, words[0]).split())
        assert f"--ros-args: unknown parameter {name!r}: {remedy}" in told
