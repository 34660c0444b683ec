"""``navfw bench flow``: cost, error and sigma of flow processors beside OpenCV's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, print_tables, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError


def flow(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder with the data sets hololens_office and tum_fr1.", show_default=False
        ),
    ] = None,
    places: Annotated[
        int,
        typer.Option(min=0, max=1000, help="Poses in each rendered world; 0: recorded pairs only."),
    ] = 6,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the rendered pairs.")] = 0,
    part: Annotated[
        str, typer.Option(help="Pairs of each sequence, by their number: all, odd or even.")
    ] = "all",
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure cost, error and sigma of flow. Compares the processors with OpenCV's."""
    with quiet_stdout():
        from navfw.bench.flow_comparison import (
            PARTS,
            bench_flow_sets,
            comparison_tables,
            recorded_sets,
            rendered_set,
        )
        from navfw.recording.provenance import provenance

        if part not in PARTS:
            raise InputError(f"must be one of {', '.join(PARTS)}, got {part!r}", key="--part")
        if data is None and not places:
            raise InputError("must be at least 1 without --data, got 0", key="--places")
        with ProgressBar("bench", quiet=quiet) as bar:
            bar.show_part("reading and rendering pairs")
            sets = [] if data is None else recorded_sets(data, PARTS[part])
            if places:
                sets.append(rendered_set(places, seed, PARTS[part]))
            result = bench_flow_sets(sets, report=bar.show_part)
        options = {"places": places, "seed": seed, "part": part} | ({"data": "DIR"} if data else {})
        result["provenance"] = provenance("navfw bench flow", options)
    if json:
        print_json(result)
        return
    print_tables(comparison_tables(result))
