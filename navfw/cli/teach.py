"""``navfw map teach``: a map out of recorded drives."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json, map_file
from navfw.cli.output import print_result, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError

_NAME = re.compile(r"(?P<time>[0-9]+(\.[0-9]+)?)=(?P<place>[A-Za-z0-9][A-Za-z0-9_.-]*)")


def teach(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="Run folders of run --record.")
    ],
    out: Annotated[
        str, typer.Option(metavar="NAME", help="Map to write: a name in maps/, or a .yaml file.")
    ],
    name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="T=PLACE", help="Name the place at T [s] of the first one. May be repeated."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace an earlier map of that name.")
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make a map of recorded drives. Several recordings must overlap to become one map."""
    from navfw.recording.teaching import teach as taught
    from navfw.topomap.map_formats import save_map

    with quiet_stdout():
        file = map_file(out, "--out", force)
        named = [_named(text) for text in name or ()]
        with ProgressBar("map teach", quiet=quiet) as bar:
            made = taught(recordings, file.stem, named, bar.show_part)
        save_map(made.topo_map, file)
    places, edges = len(made.topo_map.places), len(made.topo_map.passages)
    parts = [
        {
            "recording": str(part.file),
            "begin_s": round(part.begin, 2),
            "end_s": round(part.end, 2),
            "path_m": round(part.path, 2),
            "used": part.used,
            "ended_by": part.why,
        }
        for part in made.parts
    ]
    data = {"map": made.topo_map.name, "file": str(file), "places": places, "edges": edges}
    data |= {"loops": made.loops, "undecided": made.undecided, "parts": parts}
    lines = [f"{file}: {places} places, {edges} edges, {made.loops} loops closed"]
    if made.undecided:
        lines.append(f"{made.undecided} loops remained undecided, and are not closed")
    for part in made.parts:
        if part.why:
            lines.append(f"{part.file}: split at {part.end:.1f} s: {part.why}")
        if not part.used:
            span = f"{part.begin:.1f} to {part.end:.1f} s"
            lines.append(f"{part.file}: {span} is not in the map: {part.path:.1f} m, no overlap")
    print_result(data, lines, json=json)


def _named(text: str) -> tuple[float, str]:
    """The time [s] and the name of ``T=PLACE``."""
    match = _NAME.fullmatch(text)
    if match is None:
        raise InputError(f"expected T=PLACE, as in 12.5=dock, got {text!r}", key="--name")
    return float(match["time"]), match["place"]
