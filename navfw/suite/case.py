"""The specification of one run of a suite: plain data for a worker process, quick to import."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from navfw.suite.run_table import RunKey

if TYPE_CHECKING:
    from navfw.missions.session import Session
    from navfw.plugins import Registry
    from navfw.suite.suitefile import Look

RECORDINGS = "recordings"
"""The folder of the recorded runs' folders, beside that of the pictures."""

KeptRuns = Literal["all", "failed", "none"]
"""The runs of which something is kept: the picture, or the recording."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run: plain data that is sent to a worker process.

    Either ``world`` and ``mission`` are files, or ``family``, ``difficulty``, ``contrast``,
    ``look`` and ``seed`` define a generated world. ``stack`` is a file; empty: the stack named by
    the mission. ``content`` is the fingerprint of all that the result depends on beside the seed.
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
    contrast: float | None = None
    look: Look | None = None
    world: str = ""
    mission: str = ""
    variant: str = ""
    content: str = ""

    @property
    def setting(self) -> tuple[str, ...]:
        """What the run is made in (see ``RunRow.setting``)."""
        world = "" if self.family else self.world_name
        name, stack = self.mission_name, self.stack_name
        return (self.entry, self.family, world, name, stack, self.variant)

    @property
    def key(self) -> RunKey:
        """The key of the run in the table."""
        where = (self.entry, self.world_name, self.mission_name)
        return RunKey(*where, self.seed, self.stack_name, self.variant)

    def session(self, registry: Registry) -> Session:
        """World, mission and stack of the run, loaded and checked.

        Raises:
            InputError: one of them does not exist or is invalid.

        """
        from navfw.suite.case_session import generated_session, prepared_session

        if self.family:
            return generated_session(
                self.family,
                self.seed,
                self.difficulty,
                self.contrast,
                self.look,
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
    """A case, the folder for its picture, and of which runs picture and recording are kept.

    The folder of recordings is beside that of the pictures.
    """

    case: Case
    pictures: Path
    keep: KeptRuns = "failed"
    record: KeptRuns = "none"
