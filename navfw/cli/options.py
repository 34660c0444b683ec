"""Arguments and options shared by several commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.completion import (
    complete_map,
    complete_mission,
    complete_robot,
    complete_stack,
    complete_suite,
    complete_world,
)

World = Annotated[
    str,
    typer.Argument(metavar="WORLD", help="Name or file of a world.", autocompletion=complete_world),
]
Mission = Annotated[
    str,
    typer.Argument(
        metavar="MISSION",
        help="Name of a mission of that world, or a file.",
        autocompletion=complete_mission,
    ),
]
Map = Annotated[
    str,
    typer.Argument(metavar="MAP", help="Name or file of a map.", autocompletion=complete_map),
]
Recorded = Annotated[
    Path, typer.Argument(metavar="RUN_FOLDER", help="Run folder written by navfw run --record.")
]
Suite = Annotated[
    str,
    typer.Argument(metavar="SUITE", help="Name or file of a suite.", autocompletion=complete_suite),
]
Stack = Annotated[str, typer.Option(help="Name or file of a stack.", autocompletion=complete_stack)]
Robot = Annotated[
    str | None,
    typer.Option(
        help="Name or file of a robot [default: that of the mission, or default].",
        autocompletion=complete_robot,
    ),
]
VariantA = Annotated[
    str | None, typer.Option(help="Use only this variant of A.", show_default=False)
]
VariantB = Annotated[
    str | None, typer.Option(help="Use only this variant of B.", show_default=False)
]
NoiseSeed = Annotated[int, typer.Option(min=0, help="Seed of all noise.")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout, and nothing else.")
]


def of_robot(name: str | None) -> tuple[str, ...]:
    """The option ``--robot`` as an argument of ``--set``; none without it.

    Raises:
        UnknownNameError: there is no robot of that name.
        ConfigError: it is a path, and no such file exists.

    """
    from navfw.config.lookup import find
    from navfw.errors import ConfigError, UnknownNameError

    if name is None:
        return ()
    try:
        file = find("robot", name)
    except UnknownNameError as error:
        raise UnknownNameError(error.what, error.name, error.known, key="--robot") from None
    except ConfigError as error:
        raise ConfigError(str(error), key="--robot") from None
    return (f"robot={json.dumps(name if file.stem == name else str(file.absolute()))}",)


Record = Annotated[
    bool, typer.Option("--record", help="Record the run as MCAP, for replay, explain and viewers.")
]
Live = Annotated[
    bool, typer.Option("--live", help="Serve the run on this machine, for Foxglove or Lichtblick.")
]
LivePort = Annotated[
    int, typer.Option(min=0, max=65535, help="Port of --live; 0 takes a free one.")
]
Video = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="MP4 file to write: the camera with flow and percept beside the plan.",
        show_default=False,
    ),
]
