"""The example of a real robot: driven over loopback, it stops whatever happens to the link."""

import importlib
import json
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from docs_pages import ROOT

from navfw.missions import prepare

EXAMPLES = ROOT / "examples"
Modules = dict[str, ModuleType]


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> Modules:
    """The modules of the example, importable by each other as beside a script."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    names = ("robot_link", "simulated_robot", "drive_robot")
    return {name: importlib.import_module(name) for name in names}


@pytest.fixture
def robot() -> Iterator[subprocess.Popen[str]]:
    """A process with a simulated robot, and its output."""
    command = [sys.executable, str(EXAMPLES / "simulated_robot.py"), "empty", "straight"]
    with subprocess.Popen(  # noqa: S603 - this Python, words of our own
        [*command, "--port", "0", "--timeout", "20"], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.thorough
def test_the_stack_drives_a_robot_process_to_its_goal(
    robot: subprocess.Popen[str], modules: Modules, capsys: pytest.CaptureFixture[str]
) -> None:
    assert robot.stdout is not None
    port = robot.stdout.readline().split()[-1]
    code = modules["drive_robot"].main(["--port", port, "--goal", "1.5", "0.4", "--timeout", "20"])
    assert (code, capsys.readouterr().out) == (0, "reached\n")
    stopped = robot.stdout.readline()
    assert stopped.startswith("the other end is gone")
    assert "wheels stopped, rolled 0.0" in stopped
    x, y = map(float, re.findall(r"-?\d+\.\d+", stopped)[-2:])
    assert (x - 1.5) ** 2 + (y - 0.4) ** 2 < 0.4**2


WRONG_COMMANDS = {
    "silent": None,
    "gone": b"",
    "not a number": b'{"left": NaN, "right": 1}\n',
    "no number": b'{"left": 5}\n',
    "no message": b"[]\n",
    "endless": b" " * 5000,
}


@pytest.mark.parametrize("last", WRONG_COMMANDS.values(), ids=WRONG_COMMANDS)
def test_the_robot_stops_by_itself_when_no_sound_command_comes(
    last: bytes | None, modules: Modules
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        far = socket.create_connection(server.getsockname())
        near, _ = server.accept()
    robot_end = modules["robot_link"].RobotLink(near, 2.0)
    stack_end = modules["robot_link"].RobotLink(far, 5.0)

    def command() -> None:
        for _ in range(30):  # half a second at 0.25 m/s
            stack_end.receive()
            stack_end.send({"left": 5.0, "right": 5.0})
        if last == b"":
            stack_end.close()
        elif last is not None:
            far.sendall(last)

    stack = threading.Thread(target=command, daemon=True)
    with prepare("empty", "straight").simulation() as simulation:
        stack.start()
        ending = modules["simulated_robot"].serve(simulation, robot_end)
        stack.join(10.0)
        before = simulation.true_pose()
        simulation.advance(0.5)
        after = simulation.true_pose()
    robot_end.close()
    far.close()
    assert "wheels stopped, rolled 0.0" in ending
    assert before.x > 0.05, "it has driven"
    assert abs(after.x - before.x) < 0.005, "it rests"


READING: dict[str, Any] = {"time": 0.0, "gyro": [0.0, 0.0, 0.0], "ticks": [0, 0]}
WRONG_READINGS: dict[str, tuple[bytes, str]] = {
    "silent": (b"", "nothing came for 1.5 s"),
    "no message": (b"hello\n", "no message: b'hello\\n'"),
    "small image": (
        json.dumps(READING | {"taken": 0.0, "image": 2}).encode() + b"\nxy",
        "an image of 2 bytes, expected 160 x 120 pixels",
    ),
    "huge image": (json.dumps(READING | {"image": 10**9}).encode() + b"\n", "image of 1000000000"),
    "no gyro": (b'{"time": 0, "ticks": [0, 0]}\n', "gyro or ticks are wrong or missing"),
    "no time": (b'{"time": NaN}\n', "time is nan, expected a finite number"),
}


@pytest.mark.parametrize(("sent", "message"), WRONG_READINGS.values(), ids=WRONG_READINGS)
def test_the_drive_ends_with_a_stop_when_no_sound_reading_comes(
    sent: bytes, message: str, modules: Modules, capsys: pytest.CaptureFixture[str]
) -> None:
    received: list[bytes] = []

    def listen(server: socket.socket) -> None:
        connection, _ = server.accept()
        connection.sendall(json.dumps(READING).encode() + b"\n" + sent)
        with connection.makefile("rb") as stream:
            received.extend(stream)
        connection.close()

    with socket.create_server(("127.0.0.1", 0)) as server:
        robot = threading.Thread(target=listen, args=(server,), daemon=True)
        robot.start()
        port = str(server.getsockname()[1])
        code = modules["drive_robot"].main(["--port", port, "--timeout", "1.5"])
        robot.join(10.0)
    assert code == 1
    printed = capsys.readouterr().out
    assert printed.startswith("stopped: ")
    assert message in printed
    assert len(received) == 2, "the answer to the first reading, and the stop"
    assert json.loads(received[-1]) == {"left": 0.0, "right": 0.0}


def test_without_a_robot_there_is_one_message(
    modules: Modules, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
    assert modules["drive_robot"].main(["--port", port]) == 1
    assert "Connection refused" in capsys.readouterr().out


def test_the_page_shows_the_loop_of_the_example() -> None:
    page = (ROOT / "docs" / "real-robot.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert shown in Path(EXAMPLES / "drive_robot.py").read_text(encoding="utf-8")
