"""The simulator's truth for the plugins of a stack that says ``oracle: true``; no other gets it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from navfw.errors import SimulationError
from navfw.flow.ideal import Ideal
from navfw.signals import CameraMotion, Frame, FramePair
from navfw.sim.simulation import Simulation
from navfw.stack import Stack

__all__ = ["SimulatorTruth", "reveal"]


class SimulatorTruth:
    """Depth and motion as the simulator has them (``navfw.flow.ideal.TruthSource``)."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def depth(self, frame: Frame) -> npt.NDArray[np.float32]:
        """True depth (height, width) [m] of ``frame``, which must be the newest one."""
        newest = self._simulation.read().frame
        if newest is not frame:
            raise SimulationError(f"{frame.time:.3f} s is not the time of the newest frame")
        return self._simulation.true_depth()

    def motion(self, pair: FramePair) -> CameraMotion:
        """How the camera truly moved between the frames of ``pair``."""
        return self._simulation.true_motion(pair.past, pair.now)


def reveal(simulation: Simulation, stack: Stack) -> None:
    """Give ``stack`` the truth of ``simulation``, if its stack file admits to using it."""
    if stack.resolved.oracle and isinstance(stack.flow, Ideal):
        stack.flow.trust(SimulatorTruth(simulation))
