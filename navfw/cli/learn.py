"""``navfw learn``: tables learnt offline from drives with known true poses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfw.cli.options import Json
from navfw.cli.output import print_json, print_tables, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet


def add_to(app: typer.Typer) -> None:
    """Add ``learn`` with its commands."""
    group = typer.Typer(
        help="Learn tables offline, from drives with known true poses.", no_args_is_help=True
    )
    group.callback()(_group)
    group.command()(situations)
    app.add_typer(group, name="learn")


def _group() -> None:
    """Learn tables offline, from drives with known true poses."""


def situations(
    suite: Annotated[
        str, typer.Argument(metavar="SUITE", help="Name or file of a suite.")
    ] = "situations",
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds from A to B - 1.")] = "7000:7005",
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("situations.yaml"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Learn the situations at places. The table says how often OFFIS infers each (METHOD 4.4)."""
    with quiet_stdout():
        from navfw.bench.situation_learning import learn_situations, tables
        from navfw.plugins import default_registry
        from navfw.process.atomic import output_file, write_text
        from navfw.suite.suite_plan import plan_runs
        from navfw.suite.suitefile import load_suite, parse_seeds

        output_file(out, "--out")
        registry = default_registry()
        plan = plan_runs(load_suite(suite), parse_seeds(seeds), registry)
        with ProgressBar("learn", quiet=quiet) as bar:
            learnt = learn_situations(plan, registry, bar.show_part)
        provenance = f"navfw learn situations {suite} --seeds {seeds}: {learnt.drives} drives"
        write_text(out, learnt.table.text(provenance), parents=True)
    if json:
        print_json({"file": str(out), **learnt.as_data()})
    else:
        print_tables(tables(learnt))
        typer.echo(f"table: {out}; use it with --set topological.discrete.situations={out}")
