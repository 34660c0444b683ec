"""Arguments and options shared by several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["Json", "Map", "Mission", "NoiseSeed", "Recorded", "Stack", "World"]

World = Annotated[str, typer.Argument(metavar="WORLD", help="Name or file of a world.")]
Mission = Annotated[
    str, typer.Argument(metavar="MISSION", help="Name of a mission of that world, or a file.")
]
Map = Annotated[str, typer.Argument(metavar="MAP", help="Name or file of a map.")]
Recorded = Annotated[
    Path, typer.Argument(metavar="RUN_FOLDER", help="Run folder written by navfw run --record.")
]
Stack = Annotated[str, typer.Option(help="Name or file of a stack.")]
NoiseSeed = Annotated[int, typer.Option(min=0, help="Seed of all noise.")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout, and nothing else.")
]
