"""Types of arrays by the type of their elements, and runs of flags in arrays."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]
Int32s = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]
Image = Bytes
Mask = npt.NDArray[np.bool_]


def spans(times: Array, flags: Mask, pause: float) -> Iterator[tuple[int, int]]:
    """Yield first and last index of each run of true ``flags`` (n,), at ``times`` (n,) [s].

    Runs that are at most ``pause`` [s] apart are merged.
    """
    at = np.flatnonzero(flags)
    if len(at):
        for part in np.split(at, np.flatnonzero(np.diff(times[at]) > pause) + 1):
            yield int(part[0]), int(part[-1])
