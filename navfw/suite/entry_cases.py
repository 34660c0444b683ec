"""The runs of an entry of a suite: a case for each of its missions, then one for each seed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from navfw.config.input_file import is_file, is_folder, shown_path
from navfw.config.lookup import find, find_mission, list_missions
from navfw.config.overrides import Settings, override_texts
from navfw.errors import ConfigError, InputError
from navfw.missions.session import MissionResult
from navfw.plugins import default_registry
from navfw.suite.case import Case
from navfw.suite.suitefile import EntrySpec, Suite

_DIFFICULTY_STREAM = 0xD1F
"""Spawn key of the random stream that draws difficulties; other uses of the seed have others."""


def stacks_of(suite: Suite, index: int, variant: str = "") -> Mapping[str, Path | None]:
    """The stack of the variant, else of the entry, by its name; None: the mission's, not known yet.

    Raises:
        InputError: there is no such stack; the message has the suite's file, line and key.

    """
    of_variant = suite.variants[variant].stack if variant else None
    name = suite.spec.entries[index].stack if of_variant is None else of_variant
    if name is None:
        return {"": None}
    try:
        return stack_files([name])
    except InputError as error:
        where = "" if of_variant is None else variant
        raise suite.located(error, index, "stack", where) from None


def stack_files(names: Sequence[str]) -> dict[str, Path]:
    """Stack files by their names in the table."""
    files: dict[str, Path] = {}
    for name in names:
        file = find("stack", name).absolute()
        if file.stem in files:
            what = f"two stacks have the name {file.stem!r}, which has to be unique in the table"
            raise InputError(what, key="--stack")
        files[file.stem] = file
    return files


def case_templates(
    suite: Suite, index: int, entry: EntrySpec, worlds: Path | None
) -> Iterator[Case]:
    """A case for each mission of an entry, still without seed, stack and overrides.

    ``worlds`` replaces the folder named by the entry.

    Raises:
        InputError: a world or mission does not exist; the message has the suite's file, line and
            key.

    """
    blank = Case(0, entry.title, 0, "", "", "", "")
    if entry.family is not None:
        made = replace(blank, family=entry.family, contrast=entry.contrast, look=entry.look)
        yield replace(made, mission_name="cross")
        return
    key = "world" if entry.world is not None else "worlds"
    try:
        if entry.world is not None:
            files = [find("world", entry.world)]
        else:
            files = _world_files(suite, entry.worlds or "", worlds)
        for file in files:
            key = "missions" if entry.missions else key
            for name, mission in _missions(file, entry):
                yield replace(
                    blank,
                    world=str(file.absolute()),
                    mission=str(mission.absolute()),
                    world_name=file.parent.name,
                    mission_name=name,
                )
    except InputError as error:
        raise suite.located(error, index, key) from None


def _world_files(suite: Suite, named: str, worlds: Path | None) -> list[Path]:
    """The worlds in a folder, or the one whose own folder it is."""
    folder = worlds if worlds is not None else suite.file.parent / named
    if is_file(folder / "world.yaml"):
        return [folder / "world.yaml"]
    files = sorted(folder.glob("*/world.yaml"), key=lambda file: _natural(file.parent.name))
    if not files:
        what = "contains no worlds" if is_folder(folder) else "there is no such folder"
        help_ = "name a folder of worlds (as navfw world import writes them) with --worlds"
        raise ConfigError(f"{what}; {help_}", file=shown_path(folder))
    return files


def _natural(name: str) -> tuple[Any, ...]:
    """A key that sorts world-2 before world-10."""
    digits = "".join(c if c.isdigit() else " " for c in name).split()
    return (name.rstrip("0123456789"), [int(number) for number in digits[-1:]], name)


def _missions(world: Path, entry: EntrySpec) -> list[tuple[str, Path]]:
    of_world = world if entry.world is None else entry.world
    if entry.missions:
        files = [find_mission(of_world, name) for name in entry.missions]
        return [(file.stem, file) for file in files]
    missions = [(mission.name, mission.path) for mission in list_missions(of_world)]
    if not missions:
        raise ConfigError("the world has no missions", file=shown_path(world))
    return missions


def draw_difficulty(difficulty: float | tuple[float, float] | None, seed: int) -> float | None:
    """The difficulty of a seed: the number itself, or one drawn from the range (3 digits)."""
    if not isinstance(difficulty, tuple):
        return difficulty
    stream = np.random.SeedSequence(seed, spawn_key=(_DIFFICULTY_STREAM,))
    low, high = difficulty
    return round(low + (high - low) * float(np.random.default_rng(stream).random()), 3)


def run_generated(
    family: str,
    *,
    seed: int,
    difficulty: float | tuple[float, float] = (0.0, 1.0),
    stack: str | None = None,
    set: Settings = (),  # noqa: A002 - as on the command line
) -> MissionResult:
    """Drive the generated world of a seed, as ``navfw suite`` does; nothing is written.

    Of a range the seed draws its ``difficulty``. ``stack`` and ``set`` are those of ``navfw.run``.

    Raises:
        InputError: there is no such family or difficulty, or ``stack`` or ``set`` is wrong.

    """
    case = Case(
        index=0,
        entry=family,
        seed=seed,
        stack="" if stack is None else str(find("stack", stack)),
        stack_name=stack or "",
        world_name=f"{family}-{seed}",
        mission_name="cross",
        overrides=tuple(override_texts(set)),
        family=family,
        difficulty=draw_difficulty(difficulty, seed),
    )
    return case.session(default_registry()).run()


def with_seed(case: Case, entry: EntrySpec, seed: int) -> Case:
    """``case`` with this seed; in a generated world also with its name and difficulty."""
    if not case.family:
        return replace(case, seed=seed)
    return replace(
        case,
        seed=seed,
        world_name=f"{case.family}-{seed}",
        difficulty=draw_difficulty(entry.difficulty, seed),
    )
