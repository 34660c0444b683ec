"""The runs of a suite: every entry x mission x seed x stack, checked before the first starts."""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from navfw.config.input_file import is_file, is_folder, read_input, shown_path, traced_inputs
from navfw.config.lookup import (
    find,
    find_mission,
    list_missions,
    plugin_files,
    project_folder,
    project_plugin_folders,
    shipped_folder,
)
from navfw.config.overrides import Settings, override_texts
from navfw.errors import (
    ConfigError,
    InputError,
    MissingExtraError,
    UnknownNameError,
    checked_seed,
)
from navfw.missions.session import MissionResult
from navfw.plugins import Registry, default_registry
from navfw.recording.provenance import files_fingerprint, files_in, fingerprint, navfw_files
from navfw.suite.case import Case
from navfw.suite.suitefile import (
    EntrySpec,
    Expect,
    Suite,
    VariantSpec,
    lacking_packages,
)
from navfw.suite.taught_maps import planned_session


@dataclass(frozen=True)
class SuitePlan:
    """All runs of a suite in the order of the table, and what determines them.

    ``content`` has the fingerprints of everything that a result depends on, by name: entries, world
    and mission files, resolved stacks. Seeds are not part of it: a table may be extended by seeds.
    ``expect`` says by entry when a run passes, ``skipped`` by variant why it is left out.
    ``suite_hash`` is the SHA-256 of the suite's file, ``options`` are the options of ``navfw
    suite`` that change what is run.
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
    progress: Callable[[int, int, str], object] = lambda done, total, now: None,
) -> SuitePlan:
    """Expand a suite into its runs, and check each mission by building its stack.

    ``stacks``, if given, replace those of the entries: every entry is run with each of them. An
    entry without a stack uses the stack named by each mission. ``overrides`` are applied after
    those of the entries. ``worlds`` replaces every folder named by an entry. ``variants`` names
    those to run; all if empty. A variant whose package is not installed is listed in ``skipped``.
    ``progress`` is called with the number of missions checked, that of all, and the next world.

    Raises:
        InputError: a world, mission, family or stack does not exist or is invalid; the message has
            the suite's file, line and key.

    """
    files: Sequence[Path | None] = _stack_files(stacks)
    chosen = _chosen_variants(suite, variants, stacks)
    cases, content, skipped = list[Case](), dict[str, str](), lacking_packages(chosen)
    templates = _templates(suite, worlds, chosen)
    for number, (index, template) in enumerate(templates):
        name = template.variant
        if name in skipped:
            continue
        first = replace(template, overrides=(*template.overrides, *overrides), seed=seeds[0])
        progress(number, len(templates), first.family or first.key.world)
        try:
            checked = [
                _check_case(suite, index, replace(first, stack=str(file or "")), registry)
                for file in files or [_stack_of(suite, index, name)]
            ]
        except MissingExtraError as error:
            if not name:
                raise
            skipped[name] = str(error)
            continue
        content |= {part: value for _, parts in checked for part, value in parts.items()}
        cases += [replace(case, seed=seed) for case, _ in checked for seed in seeds]
    progress(len(templates), len(templates), "")
    if not cases:
        raise InputError(f"nothing is left to run: {'; '.join(skipped.values())}", key="variants")
    return SuitePlan(
        suite.name,
        tuple(replace(case, index=number) for number, case in enumerate(cases)),
        content,
        expect={e.title: e.expect for e in suite.spec.entries if e.expect is not None},
        skipped=skipped,
        suite_hash=hashlib.sha256(read_input(suite.file)).hexdigest(),
        options=_options(stacks, overrides, worlds),
    )


def _templates(
    suite: Suite, worlds: Path | None, variants: Mapping[str, VariantSpec]
) -> list[tuple[int, Case]]:
    """Return a case for each entry, by its index, with each mission and variant."""
    if worlds is not None and all(entry.worlds is None for entry in suite.spec.entries):
        what = f"the suite {suite.name!r} has no entry that takes a folder of worlds"
        raise InputError(what, key="--worlds")
    return [
        (
            index,
            replace(
                case,
                variant=name,
                overrides=(*entry.overrides, *variant.overrides),
                given_map=variant.given_map,
            ),
        )
        for index, entry in enumerate(suite.spec.entries)
        for case in case_templates(suite, index, worlds)
        for name, variant in variants.items()
    ]


def _stack_files(names: Sequence[str]) -> list[Path]:
    files = [find("stack", name).absolute() for name in names]
    if len({file.stem for file in files}) < len(files):
        what = f"two of the stacks {', '.join(names)} have one name, which has to be unique"
        raise InputError(f"{what} in the table", key="--stack")
    return files


def _options(
    stacks: Sequence[str], overrides: Sequence[str], worlds: Path | None
) -> tuple[str, ...]:
    options = [("--stack", name) for name in stacks] + [("--set", text) for text in overrides]
    options += [("--worlds", "DIR")] if worlds is not None else []
    return tuple(word for option in options for word in option)


def _check_case(
    suite: Suite, index: int, case: Case, registry: Registry
) -> tuple[Case, dict[str, str]]:
    """Build the session of ``case``, a case of the suite's entry ``index``, to find errors early.

    Returns the case with its stack, which may be the mission's, and the fingerprints of entry,
    stack, overrides, robot, and of each file that was read, by name; ``Case.content`` is that of
    them all. Of a family only the first seed is checked; the world of another seed may still be
    impossible, which gives a row with the outcome fault.

    Raises:
        MissingExtraError: a plugin needs a package that is not installed.
        InputError: the session cannot be built; the message has the suite's file, line and key.

    """
    entry = suite.spec.entries[index]
    try:
        with traced_inputs() as files:
            session = planned_session(case, registry)
    except MissingExtraError:
        raise
    except InputError as error:
        unknown = isinstance(error, UnknownNameError) and error.what.startswith("family")
        place = index, "family" if unknown else "", ""
        if case.variant and _valid_without_variant(suite, index, case, registry):
            place = index, "", case.variant
        with suite.locating(*place):
            raise
    case = replace(case, stack=str(session.stack_file.absolute()))
    title = f"entry {case.entry}" + (f", variant {case.variant}" if case.variant else "")
    contents: dict[str, Any] = {
        title: entry.model_dump(mode="json", exclude={"name", "worlds", "expect"}),
        f"stack {case.key.stack} of {title}": session.stack.config,
        f"overrides of {title}": case.overrides,
        f"robot of {title}": session.mission.spec.robot.model_dump(mode="json"),
    }
    files |= {file for plugin in session.stack.resolved.plugins for file in _code_of(plugin)}
    named: dict[str, list[tuple[str, Path]]] = {}
    for file in sorted(file for file in files if file.name != "pyproject.toml"):
        same = named.setdefault(_lasting_name(file, case), [])
        same.append((str(len(same)), file))
    folder = f"{project_folder() or suite.file.parent}{os.sep}"
    fingerprints = {
        **{name: fingerprint(json.dumps(p).replace(folder, "")) for name, p in contents.items()},
        **{name: files_fingerprint(same) for name, same in named.items()},
    }
    fingerprints = {name: text[:16] for name, text in fingerprints.items()}
    return replace(case, content=fingerprint(fingerprints)[:16]), fingerprints


def _code_of(plugin: type) -> Iterator[Path]:
    """Yield the file of ``plugin``, and what it may import or read beside it; none of navfw's own.

    For navfw's code the revision stands.
    """
    file = Path(inspect.getfile(plugin))
    if any(map(file.is_relative_to, navfw_files().values())):
        return
    yield file
    if file.parent in project_plugin_folders():
        others = {other.stem for other in plugin_files(file.parent)}
        yield from (f for f, inside in files_in(file.parent) if inside.stem not in others)


def _lasting_name(file: Path, case: Case) -> str:
    """Return a name of ``file`` that stays when the project, its worlds or navfw are moved."""
    places = [project_folder(), shipped_folder(), Path(__file__).parents[2]]
    inside = [file.relative_to(at).as_posix() for at in places if at and file.is_relative_to(at)]
    world = Path(case.world).parent
    own = f"{world.name}/{file.relative_to(world)}" if file.is_relative_to(world) else file.name
    return min(inside, key=len, default=own)


def _valid_without_variant(suite: Suite, index: int, case: Case, registry: Registry) -> bool:
    """Whether the case is valid without its variant, so that the variant is the cause."""
    overrides = suite.spec.entries[index].overrides
    stack = str(_stack_of(suite, index) or "")
    plain = replace(case, stack=stack, overrides=overrides, variant="")
    with contextlib.suppress(InputError):
        planned_session(plain, registry)
        return True
    return False


def _chosen_variants(
    suite: Suite, wanted: Sequence[str], stacks: Sequence[str]
) -> dict[str, VariantSpec]:
    """Return the variants to run, by name, in the suite's order."""
    for name in wanted:
        if name not in suite.spec.variants:
            raise UnknownNameError("variant", name, suite.spec.variants, key="--variant")
    chosen = {n: variant for n, variant in suite.variants.items() if not wanted or n in wanted}
    for name, variant in chosen.items():
        if stacks and variant.stack is not None:
            what = f"the variant {name!r} names a stack itself; choose others with --variant"
            raise InputError(what, key="--stack")
    return chosen


def _stack_of(suite: Suite, index: int, variant: str = "") -> Path | None:
    """Return the stack of the variant, else of the entry; None: the mission's, not known yet.

    Errors have the suite's file, line and key.
    """
    of_variant = suite.variants[variant].stack if variant else None
    name = suite.spec.entries[index].stack if of_variant is None else of_variant
    if name is None:
        return None
    with suite.locating(index, "stack", "" if of_variant is None else variant):
        return find("stack", name).absolute()


def case_templates(suite: Suite, index: int, worlds: Path | None = None) -> list[Case]:
    """Make a case for each mission of the entry ``index``, without seed, stack and overrides.

    ``worlds`` replaces the folder of worlds named by the entry.

    Raises:
        InputError: a world or mission does not exist; the message has the suite's file, line and
            key.

    """
    entry = suite.spec.entries[index]
    explore = "" if entry.explore is None else entry.explore.model_dump_json(by_alias=True)
    taught = "" if entry.taught is None else entry.taught.model_dump_json()
    case = Case(
        0,
        entry.title,
        difficulty=entry.difficulty,
        contrast=entry.contrast,
        pairs=entry.pairs,
        explore=explore,
        taught=taught,
    )
    task = "explore" if explore else "taught" if taught else ""
    if entry.family is not None:
        return [replace(case, family=entry.family, look=entry.look, mission=task)]
    key = "world" if entry.world is not None else "worlds"
    with suite.locating(index, key):
        if entry.world is not None:
            files = [find("world", entry.world)]
        else:
            files = _world_files(worlds or suite.file.parent / (entry.worlds or ""))
    if task:
        starts = [(file, file.parent / "missions" / f"{task}.yaml") for file in files]
        return [
            replace(case, world=str(w.absolute()), mission=str(m.absolute())) for w, m in starts
        ]
    with suite.locating(index, "missions" if entry.missions else key):
        missions = [(file, mission) for file in files for mission in _missions(file, entry)]
    return [
        replace(case, world=str(file.absolute()), mission=str(mission.absolute()))
        for file, mission in missions
    ]


def _world_files(folder: Path) -> list[Path]:
    """Return the worlds in a folder, or the one whose own folder it is; world-2 before world-10."""
    if is_file(folder / "world.yaml"):
        return [folder / "world.yaml"]
    files = sorted(folder.glob("*/world.yaml"), key=lambda file: _natural(file.parent.name))
    if not files:
        what = "contains no worlds" if is_folder(folder) else "there is no such folder"
        help_ = "name a folder of worlds (as navfw world import writes them) with --worlds"
        raise ConfigError(f"{what}; {help_}", file=shown_path(folder))
    return files


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(part) if part.isdecimal() else -1, part) for part in re.split(r"(\d+)", name)]


def _missions(world: Path, entry: EntrySpec) -> list[Path]:
    of_world = world if entry.world is None else entry.world
    if entry.missions:
        return [find_mission(of_world, name) for name in entry.missions]
    missions = [mission.path for mission in list_missions(of_world)]
    if not missions:
        raise ConfigError("the world has no missions", file=shown_path(world))
    return missions


def run_generated(
    family: str,
    *,
    seed: int,
    difficulty: float | tuple[float, float] = (0.0, 1.0),
    stack: str | None = None,
    set: Settings = (),  # noqa: A002 - as on the command line
) -> MissionResult:
    """Drive the generated world of a seed, as ``navfw suite`` does, without writing files.

    From a range, the seed draws ``difficulty``. ``stack`` and ``set`` are those of ``navfw.run``.

    Raises:
        InputError: there is no such family or difficulty, or ``seed``, ``stack`` or ``set`` is
            wrong.

    """
    file = "" if stack is None else str(find("stack", stack))
    changes = tuple(override_texts(set))
    case = Case(0, family, checked_seed(seed), file, changes, family, difficulty)
    return case.session(default_registry()).run()
