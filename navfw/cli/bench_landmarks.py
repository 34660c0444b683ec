"""``navfw bench landmarks``: from where landmarks are recognised, how well, at which cost."""

from __future__ import annotations

from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, print_tables, quiet_stdout, say

__all__ = ["landmarks"]


def landmarks(
    views: Annotated[
        int, typer.Option(min=1, max=1000, help="Views at each distance and angle.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the views and their noise.")] = 0,
    json: Json = False,
) -> None:
    """Measure recognition of landmarks over distance and angle, and its cost per frame."""
    with quiet_stdout():
        from navfw.bench.landmarks import bench_landmarks, tables

        result = bench_landmarks(views, seed, say)
    if json:
        print_json(result)
        return
    print_tables(tables(result))
