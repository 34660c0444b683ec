"""Tables of what a bag's sensors measured: the clock of their stamps, and angles of wheels."""

from __future__ import annotations

import math

import numpy as np

from navfw.numerics import Array

CLOCKS = 1.0
"""Difference of two clocks [s] from which they are not the same."""


class SensorClock:
    """The clock of stamps where it is not the bag's own: that of a simulation may be slower.

    ``rows`` (n, 2) are stamps and reception [s] of a topic. ``behind`` [s] is how far the clock is
    behind the bag's if it is another one and runs, else 0.
    """

    def __init__(self, rows: Array) -> None:
        behind = float(np.median(rows[:, 1] - rows[:, 0])) if len(rows) else 0.0
        runs = len(rows) > 1 and float((np.diff(rows[:, 0]) > 0.0).mean()) > 0.5
        self.behind = behind if abs(behind) > CLOCKS and runs else 0.0
        self._rows = rows

    def times(self, table: Array) -> Array:
        """Times (n,) [s] of messages with stamps and reception ``table`` (n, 2 or more).

        They are by their stamps if these overlap with those of the clock, otherwise by reception.
        """
        stamps, received = self._rows.T
        shift = received[0] - stamps[0]
        overlaps = max(table[0, 0], stamps[0]) < min(table[-1, 0], stamps[-1])
        if overlaps and (table[:, 0] != table[:, 1]).any():
            return np.asarray(table[:, 0] + shift)
        return np.asarray(np.interp(table[:, 1], received, stamps + shift))


def unwrapped(angles: Array) -> Array:
    """Return wheel ``angles`` (n, k) [rad] without the jumps of drivers that wrap them.

    They are kept within one turn, or within two (Isaac Sim).
    """
    spans = np.ptp(angles, axis=0) if len(angles) else np.zeros(angles.shape[1])
    turns = np.maximum(np.ceil(spans / math.tau - 0.01), 1.0).tolist()
    columns = [
        np.unwrap(column, period=count * math.tau) if count <= 2.0 else column
        for column, count in zip(angles.T, turns, strict=True)
    ]
    return np.stack(columns, axis=1)
