"""Repeat the paper's experiments, on a page of HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import Json
from navfw.cli.output import echo, print_json, print_table, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("reproduction"),
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings, for Table 3 on photographs: benchmarks/real-frames.md.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the noise and of the generated views.")
    ] = 0,
    views: Annotated[
        int,
        typer.Option(min=20, max=10_000, help="Number of views in the comparison of section 4.3."),
    ] = 1000,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Repeat the paper's experiments, on a page of HTML. Exit with 1 if a check of them fails."""
    with quiet_stdout():
        from navfw_benchmarks.reproduce.reproduction import reproduce as run

        with ProgressBar("reproduce", quiet=quiet) as bar:
            result = run(out, seed, views, data, bar.show_part)
    if json:
        print_json(result)
    else:
        _print(result, out)
    raise typer.Exit(0 if all(result["checks"].values()) else 1)


def _print(result: Mapping[str, Any], out: Path) -> None:
    rows = [
        (
            entry["waypoint"],
            entry["doing"],
            *(_verdict(entry["readings"], flow, rotation) for flow, rotation in _COLUMNS),
        )
        for entry in result["table2"]
    ]
    columns = [f"{flow}, rotation {rotation}" for flow, rotation in _COLUMNS]
    print_table(["waypoint", "the robot", *columns], rows, "no waypoints")
    for title, sentences in result["summary"].items():
        for sentence in sentences:
            echo(f"{title}: {sentence}")
    for name, good in result["checks"].items():
        echo(f"{'yes' if good else 'NO '}  {name}")
    times = result["timings"]
    echo(
        f"OFFIS takes {times['offis_12x16_ms']:.2f} ms (the paper: 160 ms obstacles, 580 to"
        " 620 ms situation)"
    )
    echo(f"digest {result['digest'][:16]}, page {out / 'index.html'}")


_COLUMNS = (
    ("ideal", "removed"),
    ("ideal", "left in"),
    ("block matching", "removed"),
    ("block matching", "left in"),
)


def _verdict(readings: Sequence[Mapping[str, str]], flow: str, rotation: str) -> str:
    """The verdict of the normalised mode."""
    wanted = (flow, rotation, "normalised")
    return next(r["verdict"] for r in readings if (r["flow"], r["rotation"], r["mode"]) == wanted)
