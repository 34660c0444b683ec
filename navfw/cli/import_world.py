"""``navfw world import``: worlds from Gazebo files, or from floor plans of ROS' map_server."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from navfw.assumption import Assumption
from navfw.cli.options import Json, argument, from_options, numbers_of, option
from navfw.cli.output import echo, print_assumed, print_json, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError
from navfw.process.atomic import output_place
from navfw.process.work_progress import ProgressCallback, silent


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Arguments and options of ``navfw world import``."""

    source: list[Path] = argument(
        ..., "SDF file, map_server yaml, or image of a floor plan.", metavar="FILE..."
    )
    out: Path = option(..., "Folder to write; several files get OUT/NAME each.")
    start: str | None = option(
        None, "SDF: start [m, rad]; not needed for a BARN world.", metavar="X,Y,YAW"
    )
    goal: str | None = option(None, "SDF: goal [m]; not needed for a BARN world.", metavar="X,Y")
    skip_unsupported: bool = option(
        False, "SDF: leave out unsupported elements.", "--skip-unsupported"
    )
    models: Path | None = option(None, "SDF: folder of models that are not beside the world.")
    resolution: float | None = option(None, "Image: edge of a pixel [m]; a yaml file has its own.")
    speckle: float | None = option(None, "Plan: remove spots up to this size [m] [default: 0.12].")
    gap: float | None = option(None, "Plan: close narrower openings [m] [default: 0.15].")
    inside: str | None = option(
        None,
        "Plan: import the piece of free ground with this point [m].",
        metavar="X,Y",
        show_default="the largest within walls",
    )
    name: list[str] | None = option(
        None, "Plan: name the place at a point [m]. Repeatable.", metavar="X,Y=NAME"
    )
    json: Json = False
    quiet: Quiet = False

    def check(self, file: Path) -> bool:
        """Whether ``file`` is a plan; raises InputError for an option that is not for its kind."""
        from navfw.topomap.occupancy_map import IMAGE_SUFFIXES

        kind = file.suffix.lower()
        plan = kind in {".yaml", ".yml", *IMAGE_SUFFIXES}
        others = _OF_SDF if plan else _OF_PLANS
        for name in others if kind in IMAGE_SUFFIXES else (*others, "resolution"):
            if getattr(self, name) not in (None, False):
                option = f"--{name.replace('_', '-')}"
                raise InputError(f"is not for {kind or 'such'} files; leave it out", key=option)
        return plan


_OF_SDF = ("start", "goal", "skip_unsupported", "models")
_OF_PLANS = ("speckle", "gap", "inside", "name")
Made = tuple[dict[str, Any], tuple[str, ...], tuple[str, ...], tuple[Assumption, ...]]
"""Of an imported world: the object of ``--json``, the lines to print, what was left out, and what
was assumed."""


@from_options
def import_(options: ImportOptions) -> None:
    """Import Gazebo worlds or floor plans as worlds, with a map and missions between places.

    Drive in one with navfw run FOLDER MISSION. If one of several files cannot be imported, the
    others are; exit with 2.
    """
    folders = _folders(options.source, options.out)
    with ProgressBar("import", "files", quiet=options.quiet) as bar, quiet_stdout():
        made, failed = _import_files(folders, options, bar)
    _print(made, single=len(folders) == 1, json=options.json)
    for what in failed:
        echo(f"navfw: {what}", err=True)
    if failed:
        raise typer.Exit(2)


def _folders(sources: list[Path], out: Path) -> dict[Path, Path]:
    """The folder of each file: ``out`` of a single one, else one in it with the file's name."""
    if len(sources) == 1:
        return {sources[0]: out}
    output_place(out, "--out", replaced=False)
    folders: dict[Path, Path] = {}
    for file in sources:
        if out / file.stem in folders.values():
            what = f"a second file called {file.stem!r}, which is the name of its folder in --out"
            raise InputError(f"{what}; import it on its own", file=file)
        folders[file] = out / file.stem
    return folders


def _import_files(
    folders: Mapping[Path, Path], options: ImportOptions, bar: ProgressBar
) -> tuple[list[Made], list[InputError]]:
    """Import each file into its folder: what was made, and the errors where there are several."""
    made: list[Made] = []
    failed: list[InputError] = []
    single, count = len(folders) == 1, len(folders)
    for number, (file, folder) in enumerate(folders.items(), start=1):
        try:
            import_file = _import_plan if options.check(file) else _import_gazebo
            made.append(import_file(file, folder, options, bar.show_part if single else silent))
        except InputError as error:
            if single:
                raise
            failed.append(error)
        if not single:
            bar.update(number, count, file.name)
    return made, failed


def _import_plan(source: Path, out: Path, options: ImportOptions, report: ProgressCallback) -> Made:
    from navfw.worldgen.plan_exchange import PIECES_FILE, import_plan, read_plan
    from navfw.worldgen.world_draft import MIN_PATH

    steps = {"speckle": options.speckle, "gap": options.gap}
    cleaning = {name: value for name, value in steps.items() if value is not None}
    report("reading")
    inside: Any = numbers_of("--inside", options.inside, ("X", "Y"))
    named = _named(options.name or [])
    plan = read_plan(source, options.resolution)
    made = import_plan(plan, source.stem, report, inside=inside, named=named, **cleaning)
    folder = made.write(out)
    (area, (x, y)), *others = made.clean.pieces
    kinds = Counter(place.kind for place in made.topo_map.places.values())
    places, edges, doors = kinds.total(), len(made.topo_map.passages), kinds["door"]
    data = {
        "folder": str(folder),
        "world": made.world.name,
        "walls": len(made.world.walls),
        "size_m": list(made.size),
        "free_m2": area,
        "free_at": [x, y],
        "other_pieces_m2": [other for other, _ in others],
        "places": places,
        "doors": doors,
        "kinds": sorted(kinds),
        "edges": edges,
        "missions": {name: made.lengths[name] for name in made.missions},
        "picture": None if made.clean.picture is None else str(folder / PIECES_FILE),
        "assumed": [one.as_data() for one in made.assumed],
    }
    lines = (
        f"{folder}: {made.world.description}",
        f"{area:.0f} m2 free around {x:.2f},{y:.2f}; {places} places, {doors} doors, {edges} edges",
        *(f"  navfw run {folder} {name}  ({made.lengths[name]:.1f} m)" for name in made.missions),
    )
    if made.clean.picture is not None:
        lines += (f"other pieces of free ground: {len(others)}; picture {folder / PIECES_FILE}",)
    if max(made.lengths.values()) < MIN_PATH:
        lines += (f"the plan is too small for a mission of {MIN_PATH:g} m",)
    return data, lines, (), made.assumed


def _import_gazebo(
    source: Path, out: Path, options: ImportOptions, report: ProgressCallback
) -> Made:
    from navfw.worldgen.gazebo_import import import_world
    from navfw.worldgen.world_draft import MISSION

    start: Any = numbers_of("--start", options.start, ("X", "Y", "YAW"))
    goal: Any = numbers_of("--goal", options.goal, ("X", "Y"))
    report("reading")
    made = import_world(
        source,
        start=start,
        goal=goal,
        skip_unsupported=options.skip_unsupported,
        models=options.models,
    )
    folder = made.write(out)
    data = {
        "folder": str(folder),
        "world": made.world.name,
        "mission": MISSION,
        "barn": made.barn,
        "description": made.world.description,
        "boxes": len(made.world.boxes),
        "cylinders": len(made.world.cylinders),
        "meshes": made.meshes,
        "shortest_path_m": made.shortest,
        "skipped": list(made.skipped),
        "assumed": [one.as_data() for one in made.assumed],
    }
    lines = (
        f"{folder}: {made.world.description}",
        f"{made.shortest:.1f} m from start to goal; navfw run {folder} {MISSION}",
    )
    return data, lines, tuple(made.skipped), made.assumed


def _print(made: Sequence[Made], *, single: bool, json: bool) -> None:
    """Print one object or a list of objects, or the lines of all."""
    for data, _, left_out, assumed in made:
        where = "" if single else data["folder"] + ": "
        for what in left_out:
            echo(f"{where}left out: {what}", err=True)
        print_assumed(replace(one, what=where + one.what) for one in assumed)
    if json:
        print_json(made[0][0] if single else [data for data, *_ in made])
    else:
        echo("".join(f"{line}\n" for _, lines, *_ in made for line in lines), nl=False)


def _named(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the points [m] of ``--name X,Y=NAME``, by name."""
    named: dict[str, tuple[float, float]] = {}
    for text in texts:
        at, _, name = text.partition("=")
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            what = "expected X,Y=NAME, the name of letters, digits, - and _"
            raise InputError(f"{what}; got {text!r}", key="--name")
        if name in named:
            raise InputError(f"{name!r} is given twice", key="--name")
        x, y = numbers_of("--name", at, ("X", "Y")) or (0.0, 0.0)
        named[name] = (x, y)
    return named
