"""``navfw world import``: worlds from Gazebo files, or from floor plans as of ROS' map_server."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import Json, numbers_of
from navfw.cli.output import echo, print_json, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError
from navfw.process.atomic import output_place
from navfw.process.work_progress import ProgressCallback, silent

_IMAGE_SUFFIXES = (".pgm", ".png", ".bmp")
"""Files that are imported as the image of a floor plan."""


Inside = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y",
        help="Plan: take the piece of free ground with this point [m].",
        show_default="the largest",
    ),
]
Named = Annotated[
    list[str] | None,
    typer.Option(metavar="X,Y=NAME", help="Plan: name the place at a point [m]. Repeatable."),
]


def import_(
    source: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="SDF file, map_server yaml, or image of a floor plan.",
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder to write; of several files each gets OUT/NAME.")
    ],
    start: Annotated[
        str | None,
        typer.Option(metavar="X,Y,YAW", help="SDF: start [m, rad]; not needed for a BARN world."),
    ] = None,
    goal: Annotated[
        str | None, typer.Option(metavar="X,Y", help="SDF: goal [m]; not needed for a BARN world.")
    ] = None,
    skip_unsupported: Annotated[
        bool, typer.Option("--skip-unsupported", help="SDF: leave out unsupported elements.")
    ] = False,
    models: Annotated[
        Path | None, typer.Option(help="SDF: folder of models, for meshes not beside the world.")
    ] = None,
    resolution: Annotated[
        float | None, typer.Option(help="Image: edge of a pixel [m]; a yaml file has its own.")
    ] = None,
    speckle: Annotated[
        float | None, typer.Option(help="Plan: spots up to this size vanish [m] [default: 0.12].")
    ] = None,
    gap: Annotated[
        float | None, typer.Option(help="Plan: narrower openings are closed [m] [default: 0.15].")
    ] = None,
    inside: Inside = None,
    name: Named = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make worlds of Gazebo worlds, or of floor plans: with a map, and missions between places.

    Drive in one with navfw run FOLDER MISSION. Of several files, one that cannot be imported costs
    itself alone; exit with 2 if there is one.
    """
    begin = numbers_of("--start", start, ("X", "Y", "YAW"))
    end = numbers_of("--goal", goal, ("X", "Y"))
    point = numbers_of("--inside", inside, ("X", "Y"))
    options = _ImportOptions(
        begin, end, skip_unsupported, models, resolution, speckle, gap, point, _named(name or [])
    )
    folders = _folders(source, out)
    with ProgressBar("import", "files", quiet=quiet) as bar, quiet_stdout():
        made, failed = _import_files(folders, options, bar)
    _print(made, single=len(folders) == 1, json=json)
    for what in failed:
        echo(f"navfw: {what}", err=True)
    if failed:
        raise typer.Exit(2)


@dataclass(frozen=True, slots=True)
class _ImportOptions:
    """The options of ``navfw world import`` that belong to one kind of file."""

    start: tuple[float, ...] | None
    goal: tuple[float, ...] | None
    skip_unsupported: bool
    models: Path | None
    resolution: float | None
    speckle: float | None
    gap: float | None
    inside: tuple[float, ...] | None
    named: Mapping[str, tuple[float, float]]

    def check(self, kind: str, *, plan: bool) -> None:
        """Raise InputError for an option that is not for files with the suffix ``kind``."""
        for option, value, fits in (
            ("--start", self.start, not plan),
            ("--goal", self.goal, not plan),
            ("--skip-unsupported", self.skip_unsupported or None, not plan),
            ("--models", self.models, not plan),
            ("--resolution", self.resolution, kind in _IMAGE_SUFFIXES),
            ("--speckle", self.speckle, plan),
            ("--gap", self.gap, plan),
            ("--inside", self.inside, plan),
            ("--name", self.named or None, plan),
        ):
            if value is not None and not fits:
                raise InputError(f"is not for {kind or 'such'} files; leave it out", key=option)


@dataclass(frozen=True, slots=True)
class _Imported:
    """One imported world: the object of ``--json``, its lines, and what was left out."""

    data: dict[str, Any]
    lines: tuple[str, ...]
    left_out: tuple[str, ...] = ()


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
    folders: Mapping[Path, Path], options: _ImportOptions, bar: ProgressBar
) -> tuple[list[_Imported], list[InputError]]:
    """Import each file into its folder: what was made, and the errors where there are several."""
    made: list[_Imported] = []
    failed: list[InputError] = []
    single, count = len(folders) == 1, len(folders)
    for number, (file, folder) in enumerate(folders.items(), start=1):
        kind = file.suffix.lower()
        plan = kind in {".yaml", ".yml", *_IMAGE_SUFFIXES}
        import_file, report = _import_plan if plan else _import_gazebo, bar.show_part
        try:
            options.check(kind, plan=plan)
            made.append(import_file(file, folder, options, report if single else silent))
        except InputError as error:
            if single:
                raise
            failed.append(error)
        if not single:
            bar.update(number, count, file.name)
    return made, failed


def _import_plan(
    source: Path, out: Path, options: _ImportOptions, report: ProgressCallback
) -> _Imported:
    from navfw.worldgen.plan_exchange import import_plan, read_cleaning, read_plan
    from navfw.worldgen.world_draft import MIN_PATH

    steps = read_cleaning({"speckle": options.speckle, "gap": options.gap})
    report("reading")
    inside = None if options.inside is None else (options.inside[0], options.inside[1])
    plan = read_plan(source, options.resolution)
    made = import_plan(plan, source.stem, steps, report, inside, options.named)
    folder = made.write(out)
    (area, (x, y)), *others = made.pieces
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
    }
    lines = (
        f"{folder}: {made.world.description}",
        f"{area:.0f} m2 free around {x:.2f},{y:.2f}; {places} places, {doors} doors, {edges} edges",
        *(f"  navfw run {folder} {name}  ({made.lengths[name]:.1f} m)" for name in made.missions),
    )
    for other, (x, y) in others[:1]:
        largest = f"the largest of {other:.0f} m2: --inside {x:.2f},{y:.2f} takes it"
        lines += (f"other pieces of free ground: {len(others)}, {largest}",)
    if max(made.lengths.values()) < MIN_PATH:
        lines += (f"the plan is too small for a mission of {MIN_PATH:g} m",)
    return _Imported(data, lines)


def _import_gazebo(
    source: Path, out: Path, options: _ImportOptions, report: ProgressCallback
) -> _Imported:
    from navfw.worldgen.gazebo_import import import_world
    from navfw.worldgen.world_draft import MISSION

    begin, end = options.start, options.goal
    report("reading")
    made = import_world(
        source,
        start=None if begin is None else (begin[0], begin[1], begin[2]),
        goal=None if end is None else (end[0], end[1]),
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
    }
    lines = (
        f"{folder}: {made.world.description}",
        f"{made.shortest:.1f} m from start to goal; navfw run {folder} {MISSION}",
    )
    return _Imported(data, lines, tuple(made.skipped))


def _print(made: Sequence[_Imported], *, single: bool, json: bool) -> None:
    """Print one object or a list of objects, or the lines of all."""
    for one in made:
        for what in one.left_out:
            where = "" if single else f"{one.data['folder']}: "
            echo(f"{where}left out: {what}", err=True)
    if json:
        print_json(made[0].data if single else [one.data for one in made])
    else:
        echo("".join(f"{line}\n" for one in made for line in one.lines), nl=False)


def _named(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """The points [m] of ``--name X,Y=NAME``, by name."""
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
