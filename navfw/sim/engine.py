"""Import of PyBullet without its banner: stdout is for results, stderr for messages."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


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
    with quiet_output():  # the banner
        import pybullet
    return pybullet


bullet = _import_quietly()
