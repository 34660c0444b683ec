"""Serve the live page of perceived images: ``navfw perceive --live``."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from navfw.assumption import Assumption
from navfw.config.extras import extra_imports
from navfw.numerics import Image
from navfw.recording.page_server import PageServer
from navfw.report.report_page import PerceivePage, moment_of

with extra_imports("record"):
    from websockets.asyncio.server import ServerConnection, broadcast
    from websockets.typing import Subprotocol


class PerceiveServer(PageServer):
    """Serves the results of the images called ``title`` at their own speed, until it is closed.

    It begins with the first viewer; whoever comes later sees the newest result first. With each
    result it shows what is ``assumed`` by then.

    Raises:
        InputError: the port is in use, or must not be used.

    """

    command = "navfw perceive"
    protocols = (Subprotocol("navfw.perceive.v1"),)
    max_request = 1 << 10

    def __init__(
        self, title: str, port: int = 0, assumed: Callable[[], Sequence[Assumption]] = list
    ) -> None:
        self._newest, self._begun, self._assumed = "", 0.0, assumed
        super().__init__(port, PerceivePage(title).render([], live=True))

    def add(self, picture: Image, result: Mapping[str, Any]) -> None:
        """Show an image when its time has come: its overlay (height, width, 3) BGR, its result."""
        while not (self._begun or self._server.connections):
            self.serve()
        self._begun = self._begun or time.monotonic() - result["time"]
        assumed = [f"assumed: {one}" for one in self._assumed()]
        self._newest = json.dumps({**moment_of(picture, result), "assumed": assumed})
        self.serve(max(0.0, self._begun + result["time"] - time.monotonic()))
        broadcast(self._server.connections, self._newest)
        self.serve(0.0)

    async def _view(self, client: ServerConnection) -> None:
        """Send the newest result to a viewer, and wait until it leaves."""
        if self._newest:
            broadcast([client], self._newest)
        await client.wait_closed()
