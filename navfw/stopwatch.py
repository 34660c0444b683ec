"""Wall time by stage. It measures only: no decision depends on it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

__all__ = ["timed"]


@contextlib.contextmanager
def timed(account: dict[str, float], stage: str) -> Iterator[None]:
    """Add the wall time [s] spent inside to ``account[stage]``."""
    began = time.perf_counter()
    yield
    account[stage] += time.perf_counter() - began
