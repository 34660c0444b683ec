"""The runs of a suite: every entry x mission x seed x stack, checked before the first starts."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfw.config.document import shown_path
from navfw.config.lookup import find, find_mission, list_missions
from navfw.errors import ConfigError, InputError, MissingExtraError, UnknownNameError
from navfw.missions.session import Session
from navfw.suite.case import Case
from navfw.suite.suitefile import EntrySpec, Expect, Suite, VariantSpec

if TYPE_CHECKING:
    from navfw.plugins import Registry

__all__ = ["SuitePlan", "draw_difficulty", "plan_runs"]

MAX_RUNS = 200_000

_DIFFICULTY_STREAM = 0xD1F
"""Keeps the draw of the difficulty apart from what the seed is otherwise used for."""


@dataclass(frozen=True)
class SuitePlan:
    """All runs of a suite in the order of the table, and what determines them.

    ``content`` has a fingerprint for each thing that a result depends on, by its name: entries,
    world and mission files, resolved stacks. Seeds are none of it: a table may grow by seeds.
    ``expect`` is what passes, by the entries that say so. ``suite_hash`` is the SHA-256 of the
    suite's file, ``options`` the options of ``navfw suite`` that change what is run.
    """

    suite: str
    cases: tuple[Case, ...]
    content: Mapping[str, str] = field(default_factory=dict)
    expect: Mapping[str, Expect] = field(default_factory=dict)
    skipped: Mapping[str, str] = field(default_factory=dict)
    suite_hash: str = ""
    options: tuple[str, ...] = ()


def plan_runs(
    suite: Suite,
    seeds: range,
    registry: Registry,
    *,
    stacks: Sequence[str] = (),
    overrides: Sequence[str] = (),
    worlds: Path | None = None,
    variants: Sequence[str] = (),
) -> SuitePlan:
    """Expand and check a suite.

    ``stacks``, where given, go before the entries' own: every entry is run with each of them. An
    entry without one has each mission driven with the stack that the mission names.
    ``overrides`` come after those of the entries. ``worlds`` takes the place of every folder that
    an entry names. ``variants`` are those to run, of the suite's; all if there are none. One that
    needs a package that is not installed is left out, and told in the plan's ``skipped``.

    Raises:
        InputError: a world, mission, family or stack does not exist or cannot be; the message
            names the suite's file, line and key.

    """
    if worlds is not None and all(entry.worlds is None for entry in suite.spec.entries):
        what = f"the suite {suite.name!r} has no entry that takes a folder of worlds"
        raise InputError(what, key="--worlds")
    chosen = _stack_files(stacks)
    ways = _ways(suite, variants, stacks)
    draft: list[Case] = []
    content: dict[str, str] = {}
    skipped: dict[str, str] = {}
    for index, entry in enumerate(suite.spec.entries):
        templates = list(_templates(suite, index, entry, worlds))
        for template, (variant, way) in product(templates, ways.items()):
            if variant in skipped:
                continue
            for name, file in (chosen or _stacks_of(suite, index, variant)).items():
                case = replace(
                    template,
                    stack=str(file or ""),
                    stack_name=name,
                    variant=variant,
                    overrides=(*entry.overrides, *way.overrides, *overrides),
                    seed=seeds[0],
                )
                try:
                    case, parts = _check(suite, index, case, registry)
                    content |= parts
                except MissingExtraError as error:
                    if not variant:
                        raise
                    skipped[variant] = str(error)
                    break
                draft += [_with_seed(case, entry, seed) for seed in seeds]
                if len(draft) > MAX_RUNS:
                    raise InputError(f"more than {MAX_RUNS} runs; give fewer seeds", key="--seeds")
    if not draft:
        raise InputError(f"nothing is left to run: {'; '.join(skipped.values())}", key="variants")
    cases = tuple(replace(case, index=number) for number, case in enumerate(draft))
    expect = {e.title: e.expect for e in suite.spec.entries if e.expect is not None}
    options = [("--stack", name) for name in stacks] + [("--set", text) for text in overrides]
    options += [("--worlds", "DIR")] if worlds is not None else []
    return SuitePlan(
        suite.name,
        cases,
        content,
        expect,
        skipped,
        suite_hash=hashlib.sha256(suite.file.read_bytes()).hexdigest(),
        options=tuple(word for option in options for word in option),
    )


def _ways(suite: Suite, wanted: Sequence[str], stacks: Sequence[str]) -> dict[str, VariantSpec]:
    """The variants to run, by name, in the suite's order."""
    known = suite.variants
    for name in wanted:
        if name not in suite.spec.variants:
            raise UnknownNameError("variant", name, suite.spec.variants, key="--variant")
    ways = {name: way for name, way in known.items() if not wanted or name in wanted}
    for name, way in ways.items():
        if stacks and way.stack is not None:
            what = f"the variant {name!r} has a stack of its own; choose others with --variant"
            raise InputError(what, key="--stack")
    return ways


def _stacks_of(suite: Suite, index: int, variant: str) -> Mapping[str, Path | None]:
    """The stack of a variant, else of an entry, else of the mission, as yet unknown (None)."""
    own = suite.variants[variant].stack
    if own is None:
        return _stack_of_entry(suite, index)
    try:
        return _stack_files([own])
    except InputError as error:
        raise suite.blame(error, index, "stack", variant) from None


def _stack_of_entry(suite: Suite, index: int) -> Mapping[str, Path | None]:
    own = suite.spec.entries[index].stack
    return {"": None} if own is None else _stack_files([own], suite, index)


def draw_difficulty(difficulty: float | tuple[float, float] | None, seed: int) -> float | None:
    """The difficulty of a seed: the number itself, or one drawn from the range, to 3 digits."""
    if not isinstance(difficulty, tuple):
        return difficulty
    stream = np.random.SeedSequence(seed, spawn_key=(_DIFFICULTY_STREAM,))
    low, high = difficulty
    return round(low + (high - low) * float(np.random.default_rng(stream).random()), 3)


def _with_seed(case: Case, entry: EntrySpec, seed: int) -> Case:
    if not case.family:
        return replace(case, seed=seed)
    return replace(
        case,
        seed=seed,
        world_name=f"{case.family}-{seed}",
        difficulty=draw_difficulty(entry.difficulty, seed),
    )


def _stack_files(
    names: Sequence[str], suite: Suite | None = None, index: int = 0
) -> dict[str, Path]:
    """Stack files by the name that the table has for them."""
    found: dict[str, Path] = {}
    for name in names:
        try:
            file = find("stack", name).absolute()
        except InputError as error:
            if suite is None or suite.spec.entries[index].stack is None:
                raise
            raise suite.blame(error, index, "stack") from None
        title = file.stem
        if title in found:
            what = f"two stacks are called {title!r}, and the table could not tell them apart"
            raise InputError(what, key="--stack")
        found[title] = file
    return found


# --- what an entry stands for --------------------------------------------------------------------


def _templates(suite: Suite, index: int, entry: EntrySpec, worlds: Path | None) -> Iterator[Case]:
    """A case for each mission of an entry; seed, stack and overrides come later."""
    blank = Case(0, entry.title, 0, "", "", "", "")
    if entry.family is not None:
        yield replace(blank, family=entry.family, mission_name="cross")
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
        raise suite.blame(error, index, key) from None


def _world_files(suite: Suite, given: str, worlds: Path | None) -> list[Path]:
    """The worlds in a folder, which may be a world's own."""
    folder = worlds if worlds is not None else suite.file.parent / given
    if (folder / "world.yaml").is_file():
        return [folder / "world.yaml"]
    files = sorted(folder.glob("*/world.yaml"), key=lambda file: _natural(file.parent.name))
    if not files:
        what = "holds no worlds" if folder.is_dir() else "there is no such folder"
        help_ = "name a folder of worlds (as navfw import makes them) with --worlds"
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
    found = [(mission.name, mission.path) for mission in list_missions(of_world)]
    if not found:
        raise ConfigError("the world has no missions", file=shown_path(world))
    return found


# --- checking ------------------------------------------------------------------------------------


def _check(suite: Suite, index: int, case: Case, registry: Registry) -> tuple[Case, dict[str, str]]:
    """Build the case once, so that nothing is wrong with it later.

    Gives the case with its stack, which may be the mission's, and the fingerprints of its parts.
    Of a family only the first seed can be tried: another seed may still fail, as its run's fault.
    """
    entry = suite.spec.entries[index]
    case = _with_seed(case, entry, case.seed)
    try:
        session = case.session(registry)
    except MissingExtraError:
        raise
    except InputError as error:
        if case.variant and _runs_without_variant(suite, index, case, registry):
            raise suite.blame(error, index, None, case.variant) from None
        unknown = isinstance(error, UnknownNameError) and error.what.startswith("family")
        raise suite.blame(error, index, "family" if unknown else None) from None
    file = session.stack_file.absolute()
    case = replace(case, stack=str(file), stack_name=file.stem)
    title = f"entry {case.entry}" + (f", variant {case.variant}" if case.variant else "")
    parts = {
        title: _digest([entry.model_dump(mode="json", exclude={"name", "worlds", "expect"})]),
        f"stack {case.stack_name} of {title}": _digest([session.stack.config]),
        f"overrides of {title}": _digest(list(case.overrides)),
    }
    if not case.family:
        world, mission = Path(case.world), Path(case.mission)
        parts[f"world {case.world_name} of {title}"] = _digest(world.read_text("utf-8"))
        parts[f"mission {case.mission_name} of {case.world_name} of {title}"] = _digest(
            [mission.read_text("utf-8"), _map_of(session)]
        )
    return case, parts


def _runs_without_variant(suite: Suite, index: int, case: Case, registry: Registry) -> bool:
    """Whether the variant is to blame for a case that cannot be: without it, all is well."""
    entry = suite.spec.entries[index]
    file = next(iter(_stack_of_entry(suite, index).values()))
    plain = replace(case, stack=str(file or ""), overrides=entry.overrides, variant="")
    try:
        plain.session(registry)
    except InputError:
        return False
    return True


def _map_of(session: Session) -> dict[str, Any]:
    from navfw.topomap.mapfile import map_data

    return map_data(session.mission.topo_map)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
