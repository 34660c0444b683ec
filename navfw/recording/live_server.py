"""Serve a run's channels live by Foxglove's WebSocket protocol, and a page that shows them.

It has no thread of its own: it serves between two control ticks, and while it holds the run.
"""

from __future__ import annotations

import asyncio
import json
import struct
import time
from base64 import b64encode
from collections.abc import Iterable

from navfw.config.extras import extra_imports
from navfw.errors import InputError
from navfw.recording import channel_list as topics
from navfw.recording.channel_list import SeenRun, Topic
from navfw.recording.page_server import PageServer, tell
from navfw.signals import Pose, SensorReading, Twist

with extra_imports("record"):
    from websockets.asyncio.server import ServerConnection, broadcast
    from websockets.exceptions import ConnectionClosed
    from websockets.frames import CloseCode
    from websockets.typing import Subprotocol

    from navfw.recording.run_channels import RunChannels, channel_schema, image_message

_MIN_SPEED, _MAX_SPEED = 0.05, 50.0
"""Bounds of a run's speed [simulated time per wall time]."""
_PAGE = Subprotocol("navfw.live.v1")
"""Foxglove's protocol with messages ``navfw``: state of the run to the page, its commands back."""
_PROTOCOLS = (_PAGE, Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1"))
_MAX_WAITING = 1 << 22
"""Data [byte] waiting for a slow client above which further messages to it are dropped."""
_PERIOD = 0.05
"""Longest wall time between two looks at the clients while the run waits for its speed [s]."""
_CHASE_SHARE = 0.15
"""Largest share of the wall time that drawing the views from behind may take."""
_CATCH_UP = 0.2
"""Wall time by which a run may be behind its speed and still catch up [s]."""


class _LiveChannel:
    """A channel with its receivers: by client the head (opcode, subscription) of its messages."""

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
        """Return whether any client has subscribed to the channel."""
        return bool(self.receivers)

    def log(self, data: bytes, log_time: int) -> None:
        """Send ``data`` with the time ``log_time`` [ns] to the subscribers."""
        for client, start in self.receivers.items():
            _send(client, start + log_time.to_bytes(8, "little") + data)


def _send(client: ServerConnection, data: bytes) -> None:
    """Send binary ``data``; drop it if too much waits for the client already."""
    if client.transport.get_write_buffer_size() < _MAX_WAITING:
        broadcast([client], data)


class LiveServer(PageServer):
    """Serves the channels of a run until ``end``, as ``PageServer`` serves its page.

    ``page`` (HTML) may pause the run and set its ``speed`` [simulated per wall time], None for as
    fast as it goes; viewers can command nothing else, and the run's commands stay the same. With
    ``wait`` it begins with the first viewer. A channel that nobody has subscribed to is not
    computed; messages that a slow client does not fetch are dropped.

    Raises:
        InputError: the port is in use, or must not be used; the speed is out of its bounds.

    """

    command = "navfw run"
    foreign = f"{PageServer.foreign} (--origin of navfw run names one that may read)"
    protocols = _PROTOCOLS
    max_request = 1 << 16

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
        self._speed, self._paused, self._wait = _checked(speed), False, wait
        self._chase_due = 0.0
        self._begin(seen)
        super().__init__(port, page, origins)

    def follow(self, seen: SeenRun, page: str) -> None:
        """Serve another run at the same address from now on; viewers load its ``page``."""
        self._begin(seen)
        self.pages["/"] = page.encode()
        self._await(self._send_away())

    async def _send_away(self) -> None:
        clients = self._server.connections
        await asyncio.gather(*(client.close(CloseCode.SERVICE_RESTART) for client in clients))

    def _begin(self, seen: SeenRun) -> None:
        self._open: dict[str, _LiveChannel] = {}
        self._channels = RunChannels(self._channel, seen)
        self._seen, self._ended = seen, ""
        if seen.chase is not None:
            self._channel(topics.CHASE_IMAGE)
        self._time = self._due = 0.0
        self._joined = False
        self._last: tuple[SensorReading, Twist, Pose] | None = None

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Send one control tick (``pose`` is the true one), then delay or hold the run."""
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
        """Send the view from behind if somebody subscribed and its share of time is not used up."""
        channel, begun = self._open.get(topics.CHASE_IMAGE), time.monotonic()
        if self._seen.chase and channel and channel.has_sinks() and begun > self._chase_due:
            image, now = self._seen.chase(pose, self._seen.movers()), topics.nanoseconds(at)
            channel.log(image_message(topics.CHASE_IMAGE, image, now, "jpg"), now)
            self._chase_due = begun + (time.monotonic() - begun) / _CHASE_SHARE

    def tell_end(self, message: str) -> None:
        """Show viewers how the run ended; the server goes on."""
        self._ended = message
        self._tell_state(self._server.connections)

    def end(self, message: str = "the run has ended", *, stay: bool = False) -> None:
        """Show how the run ended, and close the server; with ``stay`` only after Ctrl-C."""
        self.tell_end(message)
        if stay:
            self.stay()
        self.close()

    def _hold(self) -> None:
        """Serve while the run stands still; a viewer that joins gets its newest frame."""
        super()._hold()
        if self._joined and self._last is not None:
            self._channels.observe(*self._last)
        self._joined = False

    def _channel(self, info: Topic) -> _LiveChannel:
        return self._open.setdefault(info, _LiveChannel(len(self._open), info))

    async def _view(self, client: ServerConnection) -> None:
        """Take the messages of a viewer; close the connection at one that cannot be read."""
        about = {"name": "navfw", "capabilities": ["time"], "supportedEncodings": []}
        tell(client, op="serverInfo", **about, metadata={})
        tell(client, op="advertise", channels=[c.advertised for c in self._open.values()])
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

    def _tell_state(self, clients: Iterable[ServerConnection]) -> None:
        state = {"paused": self._paused, "speed": self._speed, "ended": self._ended}
        for client in clients:
            if client.subprotocol == _PAGE:
                tell(client, op="navfw", **state)
            elif self._ended:
                tell(client, op="status", level=0, message=self._ended)

    def _take(self, client: ServerConnection, text: str | bytes) -> None:
        """Handle a viewer's message; raises errors of many kinds if it cannot be read."""
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
    """Return ``speed``; raise InputError if out of bounds, TypeError if it is not a number."""
    if not (speed is None or _MIN_SPEED <= speed <= _MAX_SPEED):
        raise InputError(f"is to be between {_MIN_SPEED} and {_MAX_SPEED:g}", key="--speed")
    return speed
