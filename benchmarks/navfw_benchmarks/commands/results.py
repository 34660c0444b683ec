"""Keep measured results, and write a page from them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import command_group
from navfw.cli.output import echo
from navfw.config.input_file import is_file, is_folder, read_input_text
from navfw.errors import InputError
from navfw.process.atomic import write_text

Folder = Annotated[
    Path, typer.Option(help="The folder of results and template.md; its page is FOLDER.md.")
]
_FOLDER = Path("benchmarks") / "results"


def add(
    source: Annotated[
        Path,
        typer.Argument(
            help="A suite's folder, a run folder, or a file with the JSON of navfw bench or run."
        ),
    ],
    name: Annotated[
        str | None, typer.Option(help="Of the result [default: from what was run].")
    ] = None,
    total: Annotated[
        bool, typer.Option("--total", help="All variants of a suite as one result.")
    ] = False,
    folder: Folder = _FOLDER,
) -> None:
    """Keep a result as JSON, with revision, command, seeds and kind of machine."""
    from navfw_benchmarks.results.collection import collect
    from navfw_benchmarks.results.result_file import save_result

    _check(folder)
    for result in collect(source, name, total=total):
        echo(f"{save_result(folder, result)}: {result.command}")
        if result.dirty:
            what = f"the code had uncommitted changes ({result.revision})"
            echo(f"navfw: {result.name}: {what}", err=True)


def write(
    check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit with 1 if a page is out of date.")
    ] = False,
    folder: Folder = _FOLDER,
) -> None:
    """Write FOLDER.md from the template and the results, and the marked tables of the README."""
    from navfw_benchmarks.results.results_page import current_pages

    _check(folder)
    pages = current_pages(folder)
    old = [
        page for page, text in pages.items() if not is_file(page) or read_input_text(page) != text
    ]
    for page in old:
        if not check:
            write_text(page, pages[page])
        echo(f"{page}: {'out of date; run navfw results write' if check else 'written'}")
    if not old:
        echo("up to date")
    raise typer.Exit(1 if check and old else 0)


def _check(folder: Path) -> None:
    if not is_folder(folder):
        what = "there is no such folder; name the folder of results with --folder"
        raise InputError(what, file=folder)


results = command_group("Keep measured results, and write a page from them.")
results.command()(add)
results.command()(write)
