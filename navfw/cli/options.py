"""Arguments and options that several commands have, each said once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["Json", "Map", "Mission", "NoiseSeed", "Recorded", "Stack", "World"]

World = Annotated[str, typer.Argument(help="A world's name or file.")]
Mission = Annotated[str, typer.Argument(help="A mission of that world, or a file.")]
Map = Annotated[str, typer.Argument(metavar="MAP", help="A map's name or file.")]
Recorded = Annotated[Path, typer.Argument(help="A folder that navfw run --record has left.")]
Stack = Annotated[str, typer.Option(help="A stack's name or file.")]
NoiseSeed = Annotated[int, typer.Option(min=0, help="Of all noise.")]
Json = Annotated[bool, typer.Option("--json", help="One object on stdout, nothing else.")]
