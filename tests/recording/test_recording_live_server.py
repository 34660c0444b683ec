"""``navfw run --live``: a websocket client receives the run, and the run is the same."""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections import defaultdict
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
from cli_calls import invoke
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from navfw.errors import InputError
from navfw.missions import prepare
from navfw.recording import LiveServer, unpack_reading
from navfw.recording import channel_list as topics

WANTED = (topics.COMMAND, topics.READING, topics.CAMERA_IMAGE, topics.WORLD)


class Viewer:
    """A client that subscribes to channels, and keeps what it receives by topic."""

    def __init__(self, url: str) -> None:
        self.received: dict[str, list[tuple[float, bytes]]] = defaultdict(list)
        self.advertised: dict[str, dict[str, Any]] = {}
        self.subscribed = threading.Event()
        self.thread = threading.Thread(target=self._view, args=(url,), daemon=True)
        self.thread.start()
        assert self.subscribed.wait(20)

    def _view(self, url: str) -> None:
        with connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")]) as connection:
            while not self.advertised:
                message = json.loads(connection.recv(timeout=10))
                if message["op"] == "advertise":
                    self.advertised = {c["topic"]: c for c in message["channels"]}
            wanted = [
                {"id": number, "channelId": self.advertised[topic]["id"]}
                for number, topic in enumerate(WANTED)
            ]
            connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            connection.ping().wait(10)
            self.subscribed.set()
            with suppress(ConnectionClosed):
                for data in connection:
                    if isinstance(data, bytes) and data[0] == 1:
                        number, time = struct.unpack_from("<IQ", data, 1)
                        self.received[WANTED[number]].append((1e-9 * time, data[13:]))


def test_a_client_receives_the_run_and_changes_no_command() -> None:
    session = prepare("paper-room", "through-the-door", seed=3, overrides=["mission.timeout=4"])
    plain = session.run()
    server = LiveServer(session.seen, port=0)
    viewer = Viewer(server.url)
    result = session.run(observers=[server])
    viewer.thread.join(10)
    assert not viewer.thread.is_alive(), "the server ends with the run"
    assert result.run.log.command_hash == plain.run.log.command_hash
    assert result.run.faults == ()

    assert set(viewer.advertised) == {info.topic for info in topics.CHANNELS}
    schemas = {topic: channel["schemaName"] for topic, channel in viewer.advertised.items()}
    assert schemas == {info.topic: info.schema for info in topics.CHANNELS}
    readings = viewer.received[topics.READING]
    # what is under way at the end of the run may be cut off
    assert 0.8 * result.run.log.ticks < len(readings) <= result.run.log.ticks
    log = result.run.log
    commands = dict(zip(log.time.tolist(), map(tuple, log.commands.tolist()), strict=True))
    for row in (unpack_reading(data) for _, data in readings):
        assert commands[row.time] == (row.v, row.w)
    leaders = {json.loads(data)["leader"] for _, data in viewer.received[topics.COMMAND]}
    assert leaders <= set(result.run.log.leaders)
    assert 32 < len(viewer.received[topics.CAMERA_IMAGE]) <= 41  # at 10 Hz, both ends of 4 s
    assert viewer.received[topics.WORLD]


def test_a_port_in_use_is_told_before_the_run(tmp_path: Path) -> None:
    session = prepare("empty", "straight")
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=rf"--port: port {port} cannot be served \(Address"):
            LiveServer(session.seen, port)
        words = ("--live", "--port", port, "--out", tmp_path / "run")
        done = invoke("run", "empty", "straight", *words)
    assert done.exit_code == 2
    assert f"port {port} cannot be served" in done.output
    assert list(tmp_path.iterdir()) == []
