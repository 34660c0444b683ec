"""A simulated robot that is reached over a socket, as a real one is, to try ``drive_robot.py`` on.

At each control tick it sends camera image, gyro and encoders, and takes the speeds of its wheels.
When no command comes in time, or a wrong one, it stops its wheels by itself. Its time is simulated:
the next tick begins when the command has come::

    uv run python examples/simulated_robot.py empty straight --port 5005
"""

from __future__ import annotations

import argparse
import math
import socket
from contextlib import closing

from robot_link import LinkLostError, RobotLink, number

from navfw import Simulation, open_simulation

COAST = 1.0
"""Time that the robot gets to come to rest [s]."""


def serve(simulation: Simulation, link: RobotLink) -> str:
    """Obey the stack until the link is lost, then stop; return why, and how far it rolled."""
    period = 1.0 / simulation.robot.control_rate
    while True:
        try:
            left, right = exchange(simulation, link)
        except LinkLostError as error:
            return stop(simulation, str(error), period)
        simulation.drive(left, right)
        simulation.advance(period)


def exchange(simulation: Simulation, link: RobotLink) -> tuple[float, float]:
    """Send what the sensors measure; return the wheel speeds (left, right) [rad/s] received."""
    reading = simulation.read()
    inertial, encoders = reading.inertial, reading.encoders
    message = {
        "time": reading.time,
        "gyro": [inertial.roll_rate, inertial.pitch_rate, inertial.yaw_rate],
        "ticks": [encoders.left, encoders.right],
    }
    if reading.frame is None:
        link.send(message)
    else:
        link.send(message | {"taken": reading.frame.time}, reading.frame.image.tobytes())
    command, _ = link.receive()
    return number(command, "left"), number(command, "right")


def stop(simulation: Simulation, why: str, period: float) -> str:
    """Stop the wheels and come to rest; return what to print about it."""
    before = simulation.true_pose()
    simulation.drive(0.0, 0.0)
    for _ in range(round(COAST / period)):
        simulation.advance(period)
    rest = simulation.true_pose()
    rolled = math.hypot(rest.x - before.x, rest.y - before.y)
    return f"{why}: wheels stopped, rolled {rolled:.2f} m, at ({rest.x:.2f}, {rest.y:.2f})"


def main(arguments: list[str] | None = None) -> None:
    """Wait for one connection, and serve it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("world")
    parser.add_argument("mission", help="says where the robot stands, and which robot it is")
    parser.add_argument("--port", type=int, default=5005, help="0: any free one")
    parser.add_argument("--timeout", type=float, default=1.0, help="without a command [s]")
    options = parser.parse_args(arguments)
    with (
        open_simulation(options.world, options.mission) as simulation,
        socket.create_server(("127.0.0.1", options.port)) as server,
    ):
        print(f"listening on port {server.getsockname()[1]}", flush=True)
        with closing(RobotLink(server.accept()[0], options.timeout)) as link:
            print(serve(simulation, link), flush=True)


if __name__ == "__main__":
    main()
