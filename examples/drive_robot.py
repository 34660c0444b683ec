"""Drive a robot that is reached over a socket: the stack alone, without any simulator.

What the robot sends becomes a ``SensorReading``; what ``Stack.step`` returns becomes wheel speeds.
Whatever ends the drive, an error included, the last command is to stand still::

    uv run python examples/drive_robot.py --port 5005 --map empty --goal 3 0

docs/real-robot.md tells what to change for a camera and a base of your own.
"""

from __future__ import annotations

import argparse
import socket
import sys
from contextlib import closing, suppress

import numpy as np
from robot_link import LinkLostError, RobotLink, number

from navfw import (
    CameraModel,
    Encoders,
    Frame,
    Inertial,
    NavfwError,
    Pose,
    RobotModel,
    SensorReading,
    Stack,
    Twist,
    Waypoint,
    compile_kernels,
    default_registry,
    load_map,
    load_robot,
)

STILL = 0.02
"""Speed [m/s] and turning rate [rad/s] below which the robot stands."""


def drive(link: RobotLink, stack: Stack, robot: RobotModel, start: Pose, goal: Waypoint) -> str:
    """Drive from ``start`` (map) to ``goal``; return how the drive ended, in a sentence."""
    stack.start(start, [goal])
    try:
        while True:
            twist = stack.step(receive_reading(link, robot.camera))
            ended = end_of(stack, twist)
            if ended:
                return ended
            left, right = robot.wheel_speeds(twist)
            link.send({"left": left, "right": right})
    finally:
        with suppress(LinkLostError):  # the robot then stops by itself
            link.send({"left": 0.0, "right": 0.0})


def receive_reading(link: RobotLink, camera: CameraModel) -> SensorReading:
    """Receive what the robot has measured at this control tick; LinkLostError if it is wrong."""
    message, image = link.receive()
    time = number(message, "time")
    try:
        roll, pitch, yaw = map(float, message["gyro"])
        left, right = map(int, message["ticks"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise LinkLostError("gyro or ticks are wrong or missing") from None
    frame = None
    if image:
        if len(image) != camera.width * camera.height:
            what = f"{camera.width} x {camera.height} pixels"
            raise LinkLostError(f"an image of {len(image)} bytes, expected {what}")
        pixels = np.frombuffer(image, np.uint8).reshape(camera.height, camera.width)
        frame = Frame(number(message, "taken"), pixels)
    return SensorReading(time, Inertial(time, roll, pitch, yaw), Encoders(time, left, right), frame)


def end_of(stack: Stack, twist: Twist) -> str:
    """Return how the drive has ended; an empty text while it goes on."""
    state = stack.state
    if state.fault is not None:
        return f"fault: {state.fault.reason}"
    if state.stuck:
        return f"stuck: {state.stuck}"
    still = abs(twist.v) < STILL and abs(twist.w) < STILL
    return "reached" if state.finished and still else ""


def main(arguments: list[str] | None = None) -> int:
    """Load the stack, connect and drive; return 0 if the goal was reached."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--port", type=int, default=5005)
    parser.add_argument("--robot", default="default", help="a robot's name or file")
    parser.add_argument("--stack", default="default", help="a stack's name or file")
    parser.add_argument("--map", default="empty", help="a map's name or file")
    parser.add_argument("--start", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="m, m, rad")
    parser.add_argument("--goal", type=float, nargs=2, default=(3.0, 0.0), help="in the map [m]")
    parser.add_argument("--timeout", type=float, default=1.0, help="without a reading [s]")
    options = parser.parse_args(arguments)
    try:
        robot = load_robot(options.robot)
        topo_map = load_map(options.map)
        stack = Stack.load(options.stack, robot, topo_map, default_registry())
        compile_kernels(loaded=True)  # the first tick must not wait for it
        connection = socket.create_connection(("127.0.0.1", options.port), options.timeout)
        x, y = options.goal
        goal = Waypoint(x, y, 0.3, "", "goal", final=True)
        with closing(RobotLink(connection, options.timeout)) as link:
            ended = drive(link, stack, robot, Pose(*options.start), goal)
    except (LinkLostError, NavfwError, OSError) as error:
        ended = f"stopped: {error}"
    print(ended)
    return 0 if ended == "reached" else 1


if __name__ == "__main__":
    sys.exit(main())
