"""The live server of a run: its channels by Foxglove's WebSocket protocol, and a page for them.

It has no thread of its own: it serves between two control ticks, and while it holds the run.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import socket
import struct
import time
from base64 import b64encode
from collections.abc import Awaitable, Iterable
from contextlib import suppress
from typing import Any
from urllib.parse import parse_qs, urlsplit

from navfw.config.extras import extra_imports
from navfw.errors import InputError
from navfw.process.interruption import deferred, interruptible
from navfw.recording import channel_list as topics
from navfw.recording.channel_list import SeenRun, Topic
from navfw.signals import Pose, SensorReading, Twist

with extra_imports("record"):
    from websockets.asyncio.server import ServerConnection, broadcast, serve
    from websockets.datastructures import Headers
    from websockets.exceptions import ConnectionClosed
    from websockets.http11 import Request, Response
    from websockets.typing import Subprotocol

    from navfw.recording.run_channels import RunChannels, channel_schema, image_message

_HOST = "127.0.0.1"
_MIN_SPEED, _MAX_SPEED = 0.05, 50.0
"""Bounds of a run's speed [simulated per wall time]."""
_PAGE = Subprotocol("navfw.live.v1")
"""Foxglove's protocol, and messages ``navfw``: the run's state to the page, its commands back."""
_PROTOCOLS = (_PAGE, Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1"))
_MAX_REQUEST = 1 << 16
"""Largest message from a client [byte]."""
_MAX_WAITING = 1 << 22
"""What may wait for a slow client before its messages are dropped [byte]."""
_PERIOD = 0.05
"""Wall time between two looks at the clients while the run is held [s]."""
_CHASE_SHARE = 0.15
"""Largest share of the wall time for views from behind."""
_CATCH_UP = 0.2
"""Wall time by which a run may be behind its speed and still catch up [s]."""
_SILENT = logging.Logger("navfw.live", level=logging.CRITICAL + 1)
"""What clients do wrong is nobody's news."""
_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class _LiveChannel:
    """A channel with its receivers, each with the start of its messages: opcode, subscription."""

    def __init__(self, number: int, info: Topic) -> None:
        encoding, schema = channel_schema(info)
        text = b64encode(schema.data) if encoding == "protobuf" else schema.data
        self.receivers: dict[ServerConnection, bytes] = {}
        self.advertised = {
            "id": number,
            "topic": info,
            "encoding": encoding,
            "schemaName": schema.name,
            "schemaEncoding": schema.encoding,
            "schema": text.decode(),
        }

    def has_sinks(self) -> bool:
        """Whether it has receivers."""
        return bool(self.receivers)

    def log(self, data: bytes, log_time: int) -> None:
        """Send ``data`` of ``log_time`` [ns] to the receivers."""
        for client, start in self.receivers.items():
            _send(client, start + log_time.to_bytes(8, "little") + data)


def _send(client: ServerConnection, data: bytes) -> None:
    """Send binary ``data``, unless too much waits already."""
    if client.transport.get_write_buffer_size() < _MAX_WAITING:
        broadcast([client], data)


def _tell(client: ServerConnection, **message: Any) -> None:
    """Send a message in JSON."""
    broadcast([client], json.dumps(message))


class LiveServer:
    """Serves what is ``seen`` of a run until ``end``; ``port`` 0 takes a free one.

    It listens on the loopback interface, and answers only where Host is this machine, the address
    has the token of ``url``, and Origin, which browsers send, is the page's own or one of
    ``origins``. ``page`` (HTML) may pause the run and set its ``speed`` [simulated per wall time],
    None for as fast as it goes; nothing else can be commanded, and the run gives the same commands.
    With ``wait`` it begins with the first viewer. What nobody has subscribed to is not computed,
    and what a slow client does not fetch is dropped.

    Raises:
        InputError: the port is in use, or must not be used; the speed is out of its bounds.

    """

    def __init__(
        self,
        seen: SeenRun,
        port: int,
        *,
        page: str = "",
        origins: tuple[str, ...] = (),
        speed: float | None = None,
        wait: bool = False,
    ) -> None:
        self._speed, self._paused, self._wait, self._ended = _checked(speed), False, wait, ""
        try:
            self._socket = socket.create_server((_HOST, port))
        except OSError as error:
            raise InputError(
                f"port {port} cannot be served ({error.strerror}); choose another, or 0 for any"
                " free one",
                key="--port",
            ) from None
        port = self._socket.getsockname()[1]
        self._hosts = {f"{name}:{port}" for name in (_HOST, "localhost")}
        self._origins = {*origins, *(f"http://{host}" for host in self._hosts)}
        self._token = secrets.token_urlsafe(16)
        self.url = f"http://{_HOST}:{port}/?token={self._token}"
        self._page = page.encode()
        self._open: dict[str, _LiveChannel] = {}
        self._channels = RunChannels(self._channel, seen)
        self._seen, self._chase_due = seen, 0.0
        if seen.chase is not None:
            self._channel(topics.CHASE_IMAGE)
        self._time = self._due = 0.0
        self._joined = False
        self._last: tuple[SensorReading, Twist, Pose] | None = None
        self._loop = asyncio.new_event_loop()
        self._loop.set_exception_handler(lambda *_: None)
        self._server = self._await(self._listen())

    async def _listen(self) -> Any:
        return await serve(
            self._view,
            sock=self._socket,
            process_request=self._answer,
            subprotocols=_PROTOCOLS,
            max_size=_MAX_REQUEST,
            compression=None,
            ping_interval=None,
            close_timeout=1.0,
            server_header=None,
            logger=_SILENT,
        )

    def _await(self, what: Awaitable[Any]) -> Any:
        """The result of ``what``; an interruption waits for it."""
        with deferred():
            return self._loop.run_until_complete(what)

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Send one control tick: reading, the stack's command, the true pose; hold the run."""
        self._channels.observe(reading, twist, pose)
        if reading.frame is not None:
            self._last = (reading, twist, pose)
            self._show_chase(reading.time, pose)
            now = struct.pack("<BQ", 2, topics.nanoseconds(reading.time))
            for client in self._server.connections:
                _send(client, now)
        if self._speed is not None:
            due = self._due + (reading.time - self._time) / self._speed
            self._due = max(due, time.monotonic() - _CATCH_UP)
        self._time = reading.time
        self.serve(0.0)
        while self._paused or self._wait:
            self._hold()
        while self._speed is not None and (ahead := self._due - time.monotonic()) > 0.0:
            self.serve(min(ahead, _PERIOD))

    def _show_chase(self, at: float, pose: Pose) -> None:
        """Send the view from behind, if somebody looks and its share of the time is not used up."""
        channel, begun = self._open.get(topics.CHASE_IMAGE), time.monotonic()
        if self._seen.chase and channel and channel.has_sinks() and begun > self._chase_due:
            image, now = self._seen.chase(pose, self._seen.movers()), topics.nanoseconds(at)
            channel.log(image_message(topics.CHASE_IMAGE, image, now, "jpg"), now)
            self._chase_due = begun + (time.monotonic() - begun) / _CHASE_SHARE

    def end(self, message: str = "the run has ended", *, stay: bool = False) -> None:
        """Tell how the run ended, and end the server; with ``stay`` not before Ctrl-C."""
        self._ended = message
        self._tell_state(self._server.connections)
        if stay:
            with suppress(KeyboardInterrupt), interruptible():
                while True:
                    self._hold()
        self._await(self._close())
        self._loop.close()

    async def _close(self) -> None:
        self._server.close()
        with suppress(TimeoutError):
            await asyncio.wait_for(self._server.wait_closed(), 1.0)
        left = asyncio.all_tasks() - {asyncio.current_task()}
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    def serve(self, patience: float) -> None:
        """Send what waits and take what arrives, for ``patience`` [s]."""
        self._await(asyncio.sleep(patience))

    def _hold(self) -> None:
        """Serve while the run stands still; who joins sees its newest frame."""
        self.serve(_PERIOD)
        if self._joined and self._last is not None:
            self._channels.observe(*self._last)
        self._joined = False

    def _channel(self, info: Topic) -> _LiveChannel:
        return self._open.setdefault(info, _LiveChannel(len(self._open), info))

    def _answer(self, client: ServerConnection, request: Request) -> Response | None:
        """The page, or a refusal; None for a viewer."""
        if refusal := self._refusal(request):
            return client.respond(403, f"navfw: {refusal}\n")
        if "Upgrade" in request.headers:
            return None
        headers = Headers(_HEADERS | {"Content-Length": str(len(self._page))})
        return Response(200, "OK", headers, self._page)

    async def _view(self, client: ServerConnection) -> None:
        """Take the messages of a viewer; one that cannot be read ends the connection."""
        about = {"name": "navfw", "capabilities": ["time"], "supportedEncodings": []}
        _tell(client, op="serverInfo", **about, metadata={})
        _tell(client, op="advertise", channels=[c.advertised for c in self._open.values()])
        self._tell_state([client])
        try:
            async for text in client:
                self._take(client, text)
        except (InputError, ValueError, LookupError, TypeError, RecursionError, struct.error):
            await client.close(1003)
        except ConnectionClosed:
            pass
        finally:
            for channel in self._open.values():
                channel.receivers.pop(client, None)

    def _refusal(self, request: Request) -> str:
        """Why a request is refused; "" if it is not."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return "this machine has another name"
        if not self._origins.issuperset(origins):
            return "the page is of another origin (--origin of navfw run names one that may read)"
        address = urlsplit(request.path)
        token = parse_qs(address.query).get("token", [""])[0]
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return "the address needs the token that navfw run has printed"
        return "" if address.path == "/" else "the page is at /"

    def _tell_state(self, clients: Iterable[ServerConnection]) -> None:
        state = {"paused": self._paused, "speed": self._speed, "ended": self._ended}
        for client in clients:
            if client.subprotocol == _PAGE:
                _tell(client, op="navfw", **state)
            elif self._ended:
                _tell(client, op="status", level=0, message=self._ended)

    def _take(self, client: ServerConnection, text: str | bytes) -> None:
        """Take a message of a viewer; raises errors of many kinds for one that cannot be read."""
        message = json.loads(text)
        if message["op"] == "subscribe":
            channels = [*self._open.values()]
            for wanted in message["subscriptions"]:
                start = struct.pack("<BI", 1, wanted["id"])
                channels[wanted["channelId"]].receivers[client] = start
            self._joined, self._wait = True, False
            self._channels.restart()
        elif message["op"] == "unsubscribe":
            ended = [struct.pack("<BI", 1, number) for number in message["subscriptionIds"]]
            for channel in self._open.values():
                if channel.receivers.get(client) in ended:
                    del channel.receivers[client]
        elif message["op"] == "navfw" and client.subprotocol == _PAGE:
            self._speed = _checked(message["speed"])
            self._paused = message["paused"] is True
            self._tell_state(self._server.connections)


def _checked(speed: float | None) -> float | None:
    """A speed of the run; raises InputError, or TypeError for what is no number."""
    if not (speed is None or _MIN_SPEED <= speed <= _MAX_SPEED):
        raise InputError(f"is to be between {_MIN_SPEED} and {_MAX_SPEED:g}", key="--speed")
    return speed
