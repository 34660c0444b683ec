"""``navfw bench landmarks``: recognition of landmarks by distance and angle, and its time."""

from __future__ import annotations

from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, print_tables, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet


def landmarks(
    views: Annotated[
        int, typer.Option(min=1, max=1000, help="Views at each distance and angle.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the views and their noise.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure landmark recognition. Varies distance and angle, and measures the time per frame."""
    with quiet_stdout():
        from navfw.bench.landmark_recognition import bench_landmarks, tables
        from navfw.recording.provenance import provenance

        with ProgressBar("bench", quiet=quiet) as bar:
            result = bench_landmarks(views, seed, bar.show_part)
        options = {"views": views, "seed": seed}
        result["provenance"] = provenance("navfw bench landmarks", options)
    if json:
        print_json(result)
        return
    print_tables(tables(result))
