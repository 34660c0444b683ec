"""Import of PyBullet without its banner: stdout is for results, stderr for messages."""

from __future__ import annotations

import os
import sys
from typing import Any

__all__ = ["bullet"]


def _import_quietly() -> Any:
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        # the banner is printed by C code: only redirecting the descriptors suppresses it
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        import pybullet
    finally:
        os.dup2(saved[0], 1)
        os.dup2(saved[1], 2)
        for descriptor in (nowhere, *saved):
            os.close(descriptor)
    return pybullet


bullet = _import_quietly()
