"""One drive of a mission: the simulator, and the loop around it, open while a context lasts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

from navfw.kernels import compile_kernels
from navfw.missions.oracle import plugins_of
from navfw.missions.outcome import MissionVerdict
from navfw.missions.runner import MissionLoop, RunResult
from navfw.missions.window_overlay import WindowOverlay
from navfw.plugins.simulator_access import SimulatorWatch
from navfw.sim.movers import MoverTrack
from navfw.sim.simulation import Simulation
from navfw.sim.world_changes import ChangeTrack
from navfw.stack import Stack


class MissionDrive:
    """A context manager with the ``simulator`` and the ``loop`` of one run of ``stack``.

    Kernels of imported modules that are not compiled yet are compiled when the context begins.
    What is known of the whole run only is set when the context ends: ``timings`` [s] by part,
    ``cause`` of a collision, and the tracks of what moved (``movers``) and changed (``changes``).
    """

    timings: dict[str, float]
    cause: str | None
    movers: MoverTrack
    changes: ChangeTrack

    def __init__(
        self,
        stack: Stack,
        simulation: Callable[[], Simulation],
        loop: Callable[[Simulation], MissionLoop],
    ) -> None:
        self.watch = SimulatorWatch(plugins_of(stack))
        self._stack = stack
        self._simulation = simulation
        self._make_loop = loop

    def __enter__(self) -> Self:
        compile_kernels(loaded=True)
        self.simulator = self._simulation()
        try:
            self.loop = self._make_loop(self.simulator)
            if self.simulator.window is not None:
                overlay = WindowOverlay(self.simulator.window, self._stack)
                self.loop.observers = (*self.loop.observers, overlay)
        except BaseException:
            self.simulator.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        simulator, spent = self.simulator, self.simulator.timings
        self.changes = simulator.change_track()
        self.cause = simulator.collision_cause
        self.movers = simulator.mover_track()
        self.timings = {
            "render": spent.render,
            "physics": spent.physics,
            "sensors": spent.sensors,
        }
        if self._stack.features.landmark_frames:
            self.timings["landmark_frames"] = spent.landmarks
        self.timings |= self._stack.timings
        simulator.close()

    def run(self) -> RunResult:
        """Drive to the end."""
        with self._stack.guard.on_duty(), self.watch:
            return self.loop.run()

    def advance(self) -> MissionVerdict | None:
        """Drive one control tick; the verdict if the mission ends at it."""
        with self.watch:
            return self.loop.advance()
