"""The link between the stack and a robot in these examples: messages over a TCP socket.

A message is a line of JSON. Behind one with the key ``image`` follow as many bytes as it says: the
grey values of the camera's image, row by row.
"""

from __future__ import annotations

import json
import math
import socket
from typing import Any

__all__ = ["LinkLostError", "RobotLink", "number"]

MAX_LINE = 4096
"""Longest line of a message [byte]."""

MAX_IMAGE = 4_000_000
"""Largest image [byte]."""


class LinkLostError(Exception):
    """The other end is gone, silent for too long, or sent a wrong message."""


class RobotLink:
    """Sends and receives messages; ``timeout`` [s] is how long either direction may be silent."""

    def __init__(self, connection: socket.socket, timeout: float) -> None:
        connection.settimeout(timeout)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection = connection
        self._stream = connection.makefile("rb")
        self._timeout = timeout

    def send(self, message: dict[str, Any], image: bytes = b"") -> None:
        """Send a message, with an image or without.

        Raises:
            LinkLostError: the other end does not take it.

        """
        head = message | ({"image": len(image)} if image else {})
        try:
            self._connection.sendall(json.dumps(head).encode() + b"\n" + image)
        except OSError as error:
            raise LinkLostError(f"the other end is gone: {error.strerror or error}") from None

    def receive(self) -> tuple[dict[str, Any], bytes]:
        """Wait for the next message; return it and the bytes of its image.

        Raises:
            LinkLostError: none came in time, the link is closed, or it is no message.

        """
        try:
            line = self._stream.readline(MAX_LINE)
            if not line.endswith(b"\n"):
                raise LinkLostError(
                    "a line is too long" if line else "the other end is gone: end of file"
                )
            message = json.loads(line)
            size = message.get("image", 0)
            if not isinstance(size, int) or not 0 <= size <= MAX_IMAGE:
                raise LinkLostError(f"an image of {size!r} bytes")
            image = self._stream.read(size)
        except TimeoutError:
            raise LinkLostError(f"nothing came for {self._timeout:g} s") from None
        except OSError as error:
            raise LinkLostError(f"the other end is gone: {error.strerror}") from None
        except (ValueError, AttributeError, RecursionError):
            raise LinkLostError(f"no message: {line[:40]!r}") from None
        if len(image) < size:
            raise LinkLostError("the other end is gone: end of file")
        return message, image

    def close(self) -> None:
        """Close the connection."""
        self._stream.close()
        self._connection.close()


def number(message: dict[str, Any], key: str) -> float:
    """Return the finite number at ``key`` of a message.

    Raises:
        LinkLostError: the message has none.

    """
    value = message.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise LinkLostError(f"{key} is {value!r}, expected a finite number")
    return float(value)
