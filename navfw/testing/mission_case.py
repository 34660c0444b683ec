"""One mission with one seed to drive in a test, from a ``mission`` marker or a mission file.

Pytest loads this module in every session where navfw is installed, so large modules are imported
only where they are used.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from navfw.errors import InputError, checked_seed, did_you_mean

if TYPE_CHECKING:
    from navfw.missions.session import Session

KEYS = ("world", "mission", "seeds", "stack", "set", "allow_faults")
"""Arguments of the marker, in the order in which they may be given by position."""

MARKER = (
    "mission(world, mission, seeds=(0,), stack=None, set=(), allow_faults=False): drive a mission"
    " (or each of a list of missions) once for each seed and hand the result to the `mission`"
    " fixture; `stack`: instead of the mission's; `set`: changes such as 'offis.layers=1' or"
    " {'offis.layers': 1}; `allow_faults`: faults of plugins do not fail the test"
)


@dataclass(frozen=True)
class MissionCase:
    """A mission to drive in a test; ``stack`` None: the mission's. Overrides as for ``--set``."""

    world: str
    mission: str
    seed: int = 0
    stack: str | None = None
    overrides: tuple[str, ...] = ()
    allow_faults: bool = False

    @property
    def label(self) -> str:
        """The part of the test's name that identifies the case."""
        return f"{Path(self.mission).stem}-seed{self.seed}"

    @property
    def folder_name(self) -> str:
        """The name of the case's run folder."""
        name = f"{Path(self.world).stem}-{Path(self.mission).stem}-{self.seed}"
        variant = (self.stack, self.overrides)
        if variant == (None, ()):
            return name
        return f"{name}-{hashlib.sha256(repr(variant).encode()).hexdigest()[:6]}"

    @property
    def inputs(self) -> tuple[object, ...]:
        """What distinguishes its run from others, besides code and files."""
        return self.world, self.mission, self.seed, self.stack, self.overrides

    def prepare(self) -> Session:
        """Load and check world, mission and stack.

        Raises:
            InputError: one of them is wrong.

        """
        from navfw.missions.session_setup import prepare

        return prepare(
            self.world, self.mission, seed=self.seed, stack=self.stack, overrides=self.overrides
        )


def cases_of(marker: pytest.Mark, seeds: Iterable[int]) -> Iterator[Any]:
    """Yield a ``pytest.param`` with the ``MissionCase`` of each run of the marker and of ``seeds``.

    Raises:
        InputError: an argument is unknown, missing or of the wrong type.

    """
    from navfw.config.overrides import override_texts

    arguments = _arguments(marker)
    missions, own = arguments["mission"], list(arguments.get("seeds", (0,)))
    missions = [missions] if isinstance(missions, str | Path) else list(missions)
    if not missions or not own:
        raise InputError("expected at least one mission and one seed")
    stack = arguments.get("stack")
    for mission in missions:
        for entry in widened(own, seeds):
            # a seed may have marks: pytest.param(7, marks=pytest.mark.slow)
            param = entry if hasattr(entry, "marks") else pytest.param(entry)
            (seed,) = param.values
            case = MissionCase(
                str(arguments["world"]),
                str(mission),
                checked_seed(seed),
                None if stack is None else str(stack),
                override_texts(arguments.get("set") or ()),
                bool(arguments.get("allow_faults", False)),
            )
            yield pytest.param(case, marks=param.marks, id=case.label)


def widened(own: Iterable[Any], seeds: Iterable[int]) -> list[Any]:
    """A test's ``own`` seeds (with their marks) and those of ``--mission-seeds``, each once."""
    entries = list(own)
    own_seeds = {entry.values[0] if hasattr(entry, "marks") else entry for entry in entries}
    return [*entries, *(seed for seed in seeds if seed not in own_seeds)]


def _arguments(marker: pytest.Mark) -> dict[str, Any]:
    wrong = [name for name in marker.kwargs if name not in KEYS]
    if wrong:
        raise InputError(f"unknown argument {wrong[0]!r}: {did_you_mean(wrong[0], KEYS)}")
    if len(marker.args) > len(KEYS):
        raise InputError(f"expected at most {len(KEYS)} arguments, got {len(marker.args)}")
    arguments = {**dict(zip(KEYS, marker.args, strict=False)), **marker.kwargs}
    missing = [name for name in ("world", "mission") if name not in arguments]
    if missing:
        raise InputError(f"missing argument: {' and '.join(missing)}")
    return arguments
