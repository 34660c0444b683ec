"""A display in memory: an Xvfb of the test's own, and what it shows."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

__all__ = ["VirtualDisplay", "virtual_display"]

_FIELDS = 25
"""Number of fields of the header of an X window dump, of four bytes each."""
_COLOR_BYTES = 12
"""Size of an entry of its table of colours."""


@dataclass(frozen=True, slots=True)
class VirtualDisplay:
    """The display ``name``, for ``DISPLAY``; its picture is in ``file``, an X window dump."""

    name: str
    file: Path

    def picture(self) -> npt.NDArray[np.uint8]:
        """What is shown now: (height, width, 3), red, green, blue."""
        content = self.file.read_bytes()
        header = np.frombuffer(content, dtype=">u4", count=_FIELDS).astype(int)
        size, width, height, line, colors = header[[0, 4, 5, 12, 19]].tolist()
        pixels = np.frombuffer(content, dtype=np.uint8, offset=size + _COLOR_BYTES * colors)
        rows = pixels[: height * line].reshape(height, line // 4, 4)
        return rows[:, :width, 2::-1].copy()


@contextmanager
def virtual_display(folder: Path) -> Iterator[VirtualDisplay]:
    """A display of 1024 x 768 whose picture is kept in ``folder``; skips without Xvfb."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("no Xvfb; install the package xvfb")
    reading, writing = os.pipe()
    options = ["-displayfd", str(writing), "-screen", "0", "1024x768x24", "-nolisten", "tcp"]
    process = subprocess.Popen(  # noqa: S603 - the server of this machine
        [server, *options, "-fbdir", str(folder)], pass_fds=(writing,), stderr=subprocess.DEVNULL
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as number:
            name = f":{number.readline().strip()}"
        yield VirtualDisplay(name, folder / "Xvfb_screen0")
    finally:
        process.terminate()
        process.wait(20)
