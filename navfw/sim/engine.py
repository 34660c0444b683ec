"""PyBullet, imported without its banner, and its clients: stdout is for results only."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Self

from navfw.config.extras import extra_imports, require_extra
from navfw.errors import SimulationError


@contextmanager
def quiet_output() -> Iterator[None]:
    """Discard what C code prints meanwhile: only redirecting the descriptors suppresses it."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(saved[0], 1)
        os.dup2(saved[1], 2)
        for descriptor in (nowhere, *saved):
            os.close(descriptor)


def _import_quietly() -> Any:
    with extra_imports("sim"), quiet_output():  # of the banner
        import pybullet
    require_extra("sim", "matplotlib")  # draws the picture at the end of a run
    return pybullet


bullet = _import_quietly()


class BulletClient:
    """What uses one PyBullet client of the id ``client``."""

    def __init__(self, client: int) -> None:
        self._client = client

    def _call(self, function: str, *args: Any, **kwargs: Any) -> Any:
        """The answer of PyBullet's function of that name for this client."""
        return getattr(bullet, function)(*args, physicsClientId=self._client, **kwargs)


class BulletConnection(BulletClient):
    """A PyBullet client of its own, with a window if ``gui``: close it, or use it as a context.

    Raises:
        SimulationError: PyBullet cannot be started.

    """

    def __init__(self, gui: bool = False) -> None:
        self._gui = gui
        super().__init__(-1)
        reason = "no display?" if gui else "too many simulations open?"
        try:
            with self._window_output():
                self._client = int(bullet.connect(bullet.GUI if gui else bullet.DIRECT))
        except bullet.error as error:
            reason = str(error)
        if self._client < 0:
            raise SimulationError(f"PyBullet could not be started ({reason})")

    def _window_output(self) -> AbstractContextManager[None]:
        """Discards what a window prints: all about threads and OpenGL."""
        return quiet_output() if self._gui else nullcontext()

    def close(self) -> None:
        """Disconnect from PyBullet; calling it again has no effect."""
        if self._client >= 0:
            with self._window_output():
                self._call("disconnect")
            self._client = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
