"""The check of what a behaviour proposes."""

from __future__ import annotations

import numba
import numpy as np

from navfw.signals import Array, Proposal

__all__ = ["are_degrees", "proposal_error"]


def proposal_error(proposal: object, shape: tuple[int, int]) -> str | None:
    """What is wrong with a behaviour's answer for a command grid of that shape; None if nothing."""
    if not isinstance(proposal, Proposal):
        return f"propose returned {type(proposal).__name__}, not a Proposal"
    if not 0.0 <= proposal.applicability <= 1.0:
        return f"applicability {proposal.applicability} is not in [0, 1]"
    for what in ("desirability", "prohibition"):
        layer = np.asarray(getattr(proposal, what), dtype=np.float64, order="C")
        if layer.shape != shape:
            return f"{what} has shape {layer.shape}, expected {shape}"
        if not are_degrees(layer):
            return f"{what} has values outside [0, 1]"
    return None


@numba.njit(cache=True)
def are_degrees(layer: Array) -> bool:
    """Whether all of ``layer`` (n_v, n_w) is in [0, 1], up to rounding; NaN is not."""
    valid = True
    for value in layer.flat:
        valid = valid and bool(0.0 <= value <= 1.0 + 1e-9)
    return valid
