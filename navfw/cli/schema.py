"""``navfw schema KIND``: the JSON Schema of a kind of file, for editors and other tools."""

from __future__ import annotations

from typing import Annotated

import typer

from navfw.cli.output import print_json, quiet_stdout
from navfw.scaffold.file_schemas import MODELS, schema_of


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(schema)


def schema(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help=f"Kind of file: {', '.join(MODELS)}.")
    ],
) -> None:
    """Print the JSON Schema of a kind of file. Editors complete and explain keys by it.

    It gives keys, types and bounds. What files say of each other is checked by navfw check.
    """
    with quiet_stdout():
        found = schema_of(kind)
    print_json(found)
