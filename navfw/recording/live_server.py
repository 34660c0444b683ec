"""The channels of a run served on this machine while it goes on, for Foxglove and Lichtblick.

The protocol is Foxglove's websocket. The server listens on the loopback interface alone, takes no
messages from its clients, and drops messages that a slow client does not fetch: the run never
waits.
"""

from __future__ import annotations

from navfw.config.extras import extra_imports
from navfw.errors import InputError
from navfw.recording.channel_list import nanoseconds
from navfw.recording.run_observer import SeenRun
from navfw.signals import Pose, SensorReading, Twist

_HOST = "127.0.0.1"


class LiveServer:
    """Serves what is ``seen`` of a run, until ``close``; ``port`` 0 takes a free one.

    What no client has subscribed to is not computed.

    Raises:
        InputError: the port is in use, or must not be used.

    """

    def __init__(self, seen: SeenRun, port: int) -> None:
        with extra_imports("record"):
            from foxglove import Context, start_server
            from foxglove.websocket import Capability

        from navfw.recording.run_channels import RunChannels

        context = Context()
        self._channels = RunChannels(context, seen)
        try:
            self._server = start_server(
                name="navfw",
                host=_HOST,
                port=port,
                capabilities=[Capability.Time],
                context=context,
            )
        except RuntimeError as error:
            reason = str(error).rpartition("Failed to bind port: ")[2]
            raise InputError(
                f"port {port} cannot be served ({reason}); choose another, or 0 for any free one",
                key="--port",
            ) from None
        self.url = f"ws://{_HOST}:{self._server.port}"

    def observe(self, reading: SensorReading, twist: Twist, pose: Pose) -> None:
        """Send one control tick: reading, the stack's command for it, and the true pose."""
        self._channels.observe(reading, twist, pose)
        if reading.frame is not None:
            self._server.broadcast_time(nanoseconds(reading.time))

    def close(self) -> None:
        """Send what still waits, and end the server."""
        self._channels.close()
        self._server.stop()
