"""``navfw learn``: tables that are learnt offline, on drives whose truth is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, print_tables, quiet_stdout, say

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add ``learn`` with its commands."""
    group = typer.Typer(help="Learn offline, from drives of known truth.", no_args_is_help=True)
    group.callback()(_group)
    group.command()(situations)
    app.add_typer(group, name="learn")


def _group() -> None:
    """Learn offline, from drives of known truth."""


def situations(
    suite: Annotated[
        str, typer.Argument(metavar="SUITE", help="A suite's name or file.")
    ] = "situations",
    seeds: Annotated[
        str, typer.Option(metavar="A:B", help="From A up to, but not including, B.")
    ] = "7000:7005",
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("situations.yaml"),
    json: Json = False,
) -> None:
    """Learn what OFFIS says at which kinds of place, for localisation (METHOD 4.4)."""
    with quiet_stdout():
        from navfw.bench.situation_learning import learn_situations, tables
        from navfw.errors import InputError
        from navfw.plugins import default_registry
        from navfw.suite.suite_plan import plan_runs
        from navfw.suite.suitefile import load_suite, parse_seeds

        if out.is_dir():
            raise InputError("is a folder; give a file to write", file=out, key="--out")
        registry = default_registry()
        plan = plan_runs(load_suite(suite), parse_seeds(seeds), registry)
        learnt = learn_situations(plan, registry, say)
        told = f"navfw learn situations {suite} --seeds {seeds}: {learnt.drives} drives"
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_text(learnt.table.text(told), encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=out) from None
    if json:
        print_json({"file": str(out), **learnt.as_data()})
    else:
        print_tables(tables(learnt))
        typer.echo(f"table: {out}; use it with --set topological.discrete.situations={out}")
