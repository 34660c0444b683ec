"""Serve a command's page to browsers on this machine only, with a WebSocket for messages.

It has no thread of its own: it serves while ``serve`` or ``stay`` is called.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import socket
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Sequence
from contextlib import suppress
from typing import Any, ClassVar, cast
from urllib.parse import parse_qs, urlsplit
from weakref import WeakSet

from navfw.config.extras import extra_imports
from navfw.errors import InputError
from navfw.process.interruption import deferred, interruptible

with extra_imports("record"):
    from websockets.asyncio.server import ServerConnection, broadcast, serve
    from websockets.datastructures import Headers
    from websockets.http11 import Request, Response
    from websockets.protocol import State
    from websockets.typing import Subprotocol

_HOST = "127.0.0.1"
_PERIOD = 0.05
"""Wall time between two looks at the clients while nothing else is done [s]."""
_SILENT = logging.Logger("navfw.page", level=logging.CRITICAL + 1)
"""A logger that drops all: errors of clients are not reported."""
_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


def tell(client: ServerConnection, **message: Any) -> None:
    """Send a message in JSON to a client."""
    broadcast([client], json.dumps(message))


class PageServer(ABC):
    """Serves ``page`` (HTML) at ``url`` and takes its viewers' messages; port 0: any free one.

    It listens on the loopback interface, and answers only if Host is this machine, the address has
    the token of ``url``, and Origin, which browsers send, is the page's own or one of ``origins``.
    ``pages`` are the contents by path; further ones may be added.

    Raises:
        InputError: the port is in use, or must not be used.

    """

    command: ClassVar[str]
    """The command that has printed the address, named in refusals."""
    foreign: ClassVar[str] = "the page is of another origin"
    """The refusal sent to a page of another origin."""
    protocols: ClassVar[Sequence[Subprotocol]]
    """The subprotocols that the WebSocket accepts."""
    max_request: ClassVar[int]
    """Largest message from a client [byte]; larger ones end the connection."""

    def __init__(self, port: int, page: str, origins: tuple[str, ...] = ()) -> None:
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
        self.pages = {"/": page.encode()}
        self._connections: WeakSet[ServerConnection] = WeakSet()
        self._loop = asyncio.new_event_loop()
        self._loop.set_exception_handler(lambda *_: None)
        self._server = self._await(self._listen())

    @abstractmethod
    async def _view(self, client: ServerConnection) -> None:
        """Take the messages of a viewer until it leaves."""

    async def _listen(self) -> Any:
        return await serve(
            self._view,
            sock=self._socket,
            process_request=self._answer,
            create_connection=cast("type[ServerConnection]", self._connection),
            subprotocols=self.protocols,
            max_size=self.max_request,
            compression=None,
            ping_interval=None,
            close_timeout=1.0,
            server_header=None,
            logger=_SILENT,
        )

    def _connection(self, *protocol: Any, **limits: Any) -> ServerConnection:
        client = ServerConnection(*protocol, **limits)
        self._connections.add(client)
        return client

    def _await(self, what: Awaitable[Any]) -> Any:
        """Return the result of ``what``; an interruption waits for it."""
        with deferred():
            return self._loop.run_until_complete(what)

    def serve(self, patience: float = _PERIOD) -> None:
        """Send waiting messages and handle arriving ones, for ``patience`` [s] of wall time."""
        self._await(asyncio.sleep(patience))

    def stay(self) -> None:
        """Serve until Ctrl-C, and return then."""
        with suppress(KeyboardInterrupt), interruptible():
            while True:
                self._hold()

    def _hold(self) -> None:
        """Serve for a moment while nothing else is done."""
        self.serve()

    def close(self) -> None:
        """Close the server and its connections; tasks of viewers are cancelled after 1 s."""
        self._await(self._close())
        self._loop.close()

    async def _close(self) -> None:
        self._server.close()
        await asyncio.sleep(0)
        for client in self._connections:  # browsers open some ahead, and never ask for anything
            if client.state is State.CONNECTING:
                client.transport.abort()
        with suppress(TimeoutError):
            await asyncio.wait_for(self._server.wait_closed(), 1.0)
        left = asyncio.all_tasks() - {asyncio.current_task()}
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    def _answer(self, client: ServerConnection, request: Request) -> Response | None:
        """Return the page, or a refusal; None for a request of a WebSocket."""
        if refusal := self._refusal(request):
            return client.respond(403, f"navfw: {refusal}\n")
        if "Upgrade" in request.headers:
            return None
        page = self.pages[urlsplit(request.path).path]
        headers = Headers(_HEADERS | {"Content-Length": str(len(page))})
        return Response(200, "OK", headers, page)

    def _refusal(self, request: Request) -> str:
        """Return why a request is refused; "" if it is answered."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return "this machine has another name"
        if not self._origins.issuperset(origins):
            return self.foreign
        address = urlsplit(request.path)
        token = parse_qs(address.query).get("token", [""])[0]
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return f"the address needs the token that {self.command} has printed"
        return "" if address.path in self.pages else "the page is at /"
