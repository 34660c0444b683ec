"""One run to be made, as it travels to a worker process: plain data, quick to import."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from navfw.suite.run_table import RunKey

if TYPE_CHECKING:
    from navfw.missions.session import Session
    from navfw.plugins import Registry

__all__ = ["Case", "Job", "Keep"]

Keep = Literal["all", "failed", "none"]
"""Of which runs the picture is kept."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run to be made: plain data that travels to a worker process.

    Either ``world`` and ``mission`` are files, or ``family`` and ``difficulty`` say what the seed
    generates. ``stack`` is a file; empty: the one that the mission names.
    """

    index: int
    entry: str
    seed: int
    stack: str
    stack_name: str
    world_name: str
    mission_name: str
    overrides: tuple[str, ...] = ()
    family: str = ""
    difficulty: float | None = None
    world: str = ""
    mission: str = ""
    variant: str = ""

    @property
    def key(self) -> RunKey:
        """Which run it is."""
        where = (self.entry, self.world_name, self.mission_name)
        return RunKey(*where, self.seed, self.stack_name, self.variant)

    def session(self, registry: Registry) -> Session:
        """Everything the run needs, found and checked.

        Raises:
            InputError: something does not exist, or cannot be.

        """
        from navfw.suite.case_session import generated_session, prepared_session

        if self.family:
            return generated_session(
                self.family,
                self.seed,
                self.difficulty,
                stack=self.stack or None,
                overrides=self.overrides,
                registry=registry,
                world_name=self.world_name,
            )
        return prepared_session(
            self.world,
            self.mission,
            self.seed,
            stack=self.stack or None,
            overrides=self.overrides,
            registry=registry,
        )


@dataclass(frozen=True, slots=True)
class Job:
    """A case, and where its picture goes (a folder), if it is kept."""

    case: Case
    pictures: Path
    keep: Keep = "failed"
