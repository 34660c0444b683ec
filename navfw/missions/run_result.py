"""The result of a run: its fields have the names of ``navfw run --json``.

The JSON, the row of a suite, the page and the lines of the terminal are views of it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from navfw.missions.mission_events import EventRecord
from navfw.missions.outcome import Outcome
from navfw.missions.run_metrics import RunMetrics
from navfw.recording.run_observers import Contact


@dataclass(frozen=True, kw_only=True)
class RunResult(RunMetrics):
    """Outcome and metrics of a run, as plain data.

    ``collision_cause`` is "mover" when a mover ran into a robot that was not driving towards it,
    "robot" for any other collision, None without one; ``contacts`` has the first contact of each.
    ``oracle_plugins`` names the plugins that use the simulator's truth, declared or by their
    source. ``faults`` are what plugins did wrong, ``objections`` the plugins that failed in more
    than a tenth of their calls, but for those that the mission's events made fail.
    """

    outcome: Outcome
    reason: str
    world: str
    mission: str
    seed: int
    behavior: str
    tick: int
    sim_time_s: float
    wall_time_s: float
    real_time_factor: float
    collision_cause: str | None
    contacts: tuple[Contact, ...]
    command_hash: str
    oracle: bool
    oracle_plugins: tuple[str, ...]
    faults: tuple[str, ...]
    objections: tuple[str, ...]
    events: tuple[EventRecord, ...]

    @property
    def metrics(self) -> RunMetrics:
        """The metrics among the fields: ``result.metrics.spl`` is ``result.spl``."""
        return self

    def summary(self) -> dict[str, Any]:
        """The content of ``navfw run --json``: one flat object, the outcome first."""
        metrics = {one.name for one in fields(RunMetrics)}
        names = sorted((one.name for one in fields(RunResult)), key=metrics.__contains__)
        return {
            **{name: getattr(self, name) for name in names},
            "outcome": str(self.outcome),
            "contacts": [*map(asdict, self.contacts)],
            "events": [event.as_data() for event in self.events],
        }
