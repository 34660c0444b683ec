"""Whatever is sent to the live server, a run goes on: 2,000 seeded requests, most malformed."""

import json
import logging
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any

import pytest
from fuzz_mutations import mutate_data
from websockets.frames import Frame, Opcode

from navfw.missions import prepare
from navfw.missions.pilot import watcher_of
from navfw.recording.live_server import LiveServer
from navfw.signals import Pose, SensorReading, Twist

REQUESTS = 2000
PER_TICK = 9
KEPT = 12
"""Connections that are left open, half a request sent or nothing read."""

LINES = (
    b"GET //[::1 HTTP/1.1",
    b"GET /?token=%00%ff HTTP/1.1",
    b"GET /?token=\xff\xfe HTTP/1.1",
    b"GET http://[::1/?token=1 HTTP/1.1",
    b"GET /#?token=&token=& HTTP/1.0",
    b"GET * HTTP/1.1",
    b"POST / HTTP/1.1",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"",
    b"GET /" + b"a" * 9000 + b" HTTP/1.1",
)
HEADERS = (
    b"Host: 127.0.0.1",
    b"Host: [::1",
    b"Origin: http://[::1",
    b"Upgrade: websocket\r\nConnection: Upgrade",
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13",
    b"Sec-WebSocket-Version: 99999999999999999999",
    b"Sec-WebSocket-Extensions: permessage-deflate; server_max_window_bits=99",
    b"Content-Length: -1",
    b"Transfer-Encoding: chunked",
    b"X: " + b"x" * 20_000,
    b"\r\n".join(b"X-%d: 1" % n for n in range(300)),
    b": no name",
    b"\x00\xff: \x80",
)
MESSAGES: tuple[Any, ...] = (
    {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 3}, {"id": 1, "channelId": 0}]},
    {"op": "unsubscribe", "subscriptionIds": [7, 1]},
    {"op": "navfw", "paused": False, "speed": None},
    {"op": "navfw", "paused": False, "speed": 50.0},
)


def text_of(random: Random) -> bytes:
    """A message, changed in most cases; never one that rightly pauses or slows the run."""
    data = random.choice(MESSAGES)
    for _ in range(random.choice((0, 1, 1, 3))):
        data = mutate_data(data, random)
    if isinstance(data, dict) and data.get("op") == "navfw":
        speed = data.get("speed")
        data |= {"paused": False, "speed": 50.0 if isinstance(speed, int | float) else speed}
    try:
        text = json.dumps(data, default=str)[:60_000].encode("utf-8", "surrogatepass")
    except ValueError:  # an integer of too many digits
        text = b'{"op": ' + b"9" * 5000 + b"}"
    return text if random.random() < 0.8 else text.replace(b"e", b"\xff", 2)


def frames(random: Random) -> bytes:
    """WebSocket frames, some damaged."""
    sent = b""
    for _ in range(random.randint(1, 4)):
        kind = random.choice([Opcode.TEXT] * 5 + [*Opcode])
        whole = random.random() < 0.9
        data = (
            text_of(random) if random.random() < 0.8 else random.randbytes(random.randint(0, 200))
        )
        with suppress(Exception):  # a control frame that is too long, and the like
            sent += Frame(kind, data, fin=whole).serialize(mask=random.random() < 0.95)
    if random.random() < 0.3:
        at = random.randint(0, len(sent))
        sent = sent[:at] + random.randbytes(random.randint(1, 9)) + sent[at + 1 :]
    return sent


def request(random: Random, host: str, path: str) -> bytes:
    """A request; two thirds know the token, and half of these send frames as well."""
    if random.random() < 0.33:
        lines = [random.choice(LINES), *random.choices(HEADERS, k=random.randint(0, 5))]
        return b"\r\n".join(lines) + random.choice((b"\r\n\r\n", b"\r\n", b"\n\n"))
    lines = [f"GET {path} HTTP/1.1".encode(), f"Host: {host}".encode()]
    if random.random() < 0.8:
        protocol = random.choice(("navfw.live.v1", "foxglove.sdk.v1", "unknown", "navfw.live.v1,,"))
        lines += [*HEADERS[3:5], f"Sec-WebSocket-Protocol: {protocol}".encode()]
    lines += random.choices(HEADERS, k=random.choice((0, 0, 0, 1)))
    return b"\r\n".join(lines) + b"\r\n\r\n" + frames(random)


class Attacker:
    """Sends ``PER_TICK`` requests before each control tick; some connections stay open."""

    def __init__(self, url: str, seed: int) -> None:
        self._random = Random(seed)  # noqa: S311 - no cryptography
        self._host, _, path = url.removeprefix("http://").partition("/")
        self._path = f"/{path}"
        self._kept: list[tuple[socket.socket, bytes]] = []
        self.sent = 0

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        for _ in range(PER_TICK if self.sent < REQUESTS else 0):
            self._send(request(self._random, self._host, self._path))
        for connection, rest in self._kept[KEPT:]:
            deliver(connection, rest)
            connection.close()
        del self._kept[KEPT:]
        self._random.shuffle(self._kept)

    def _send(self, data: bytes) -> None:
        self.sent += 1
        name, _, port = self._host.partition(":")
        connection = socket.create_connection((name, int(port)))
        connection.setblocking(False)
        cut = self._random.randint(0, len(data)) if self._random.random() < 0.3 else len(data)
        deliver(connection, data[:cut])
        end = self._random.choice(ENDS)
        if end is None:
            self._kept.insert(0, (connection, data[cut:]))
            return
        with suppress(OSError):
            end(connection)
        connection.close()

    def close(self) -> None:
        for connection, _ in self._kept:
            connection.close()


def deliver(connection: socket.socket, data: bytes) -> None:
    """Send as much as the connection takes."""
    with suppress(OSError):
        connection.send(data)


def reset(connection: socket.socket) -> None:
    """Have the connection closed at once, what it has sent dropped."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def half_close(connection: socket.socket) -> None:
    """Send no more, and read nothing."""
    connection.shutdown(socket.SHUT_WR)


ENDS: tuple[Callable[[socket.socket], object] | None, ...] = (None, None, reset, half_close)


def test_a_request_that_cannot_be_read_costs_its_own_connection_only(
    caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    run_under_fire(40, caplog, capfd)


@pytest.mark.slow
def test_two_thousand_requests_change_nothing_in_a_run(
    caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    run_under_fire(REQUESTS, caplog, capfd)


def run_under_fire(
    count: int, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    seconds = max(0.5, count / PER_TICK / 60.0 + 0.1)
    shown = prepare("empty", "straight", overrides=[f"mission.timeout={seconds}"])
    plain = shown.run()
    server = LiveServer(shown.seen, 0, page="<p>" * 20_000)
    attacker = Attacker(server.url, seed=48)
    result = shown.run(watcher_of(attacker.observe), watcher_of(server.observe))
    attacker.close()
    server.end()
    assert (result.outcome, result.reason) == (plain.outcome, plain.reason), result.verdict
    assert result.log.command_hash == plain.log.command_hash
    assert result.faults == ()
    assert attacker.sent >= count
    assert [record for record in caplog.records if record.levelno >= logging.WARNING] == []
    assert capfd.readouterr() == ("", "")
