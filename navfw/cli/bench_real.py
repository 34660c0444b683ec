"""``navfw bench real``: sentences on real frames, judged by labels."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, print_table, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.errors import InputError

_SPLITS = ("tuning", "test", "all")


def real(
    data: Annotated[Path, typer.Option(help="Folder of the recordings.", show_default=False)],
    split: Annotated[str, typer.Option(help="Labelled frames: tuning, test or all.")] = "test",
    flow: Annotated[
        list[str] | None,
        typer.Option(help="Flow processor, repeatable. Default: perceive's and OpenCV's."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge perception on real frames by labels. Counts right, partly right, wrong and silent."""
    with quiet_stdout():
        from navfw.bench.real_benchmark import bench_real, real_rows
        from navfw.bench.real_labels import SentenceVerdict
        from navfw.perceive.perceiver_options import PerceiverOptions
        from navfw.plugins import default_registry
        from navfw.recording.provenance import provenance

        if split not in _SPLITS:
            raise InputError(f"must be one of {', '.join(_SPLITS)}, got {split!r}", key="--split")
        names = flow or [PerceiverOptions().flow, "dis", "lucas_kanade", "farneback"]
        with ProgressBar("bench", quiet=quiet) as bar:
            result = bench_real(data, split, names, default_registry(), bar.show_part)
        result["provenance"] = provenance("navfw bench real", {"data": "DIR", "split": split})
    if json:
        print_json(result)
        return
    heads = [
        "flow",
        "part",
        *SentenceVerdict,
        "good",
        "headings known",
        "sigma [deg]",
        "error [deg]",
        "trusted",
        "nearness error",
        "yaw r",
        "yaw slope",
    ]
    print_table(heads, real_rows(result), "no labelled frames")
