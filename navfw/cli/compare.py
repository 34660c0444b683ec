"""``navfw compare``: two tables of suites, run by run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from navfw.cli.options import Json, VariantA, VariantB
from navfw.cli.output import print_json, print_status
from navfw.errors import InputError

MAX_SHOWN = 25
"""Largest number of runs to print of each kind; ``--json`` has all."""


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(compare)


_FailIfWorse = Annotated[
    str | None,
    typer.Option(metavar="SHARE", help="Exit with 1 if success fell by more, as in 1%."),
]


def compare(
    a: Annotated[Path, typer.Argument(help="table.csv of a suite, or its folder.")],
    b: Annotated[Path, typer.Argument(help="Another one, with the same seeds.")],
    variant_a: VariantA = None,
    variant_b: VariantB = None,
    fail_if_worse: _FailIfWorse = None,
    json: Json = False,
) -> None:
    """Compare two tables run by run, the worst regressions first.

    With --fail-if-worse, exit with 1 if B succeeds more rarely than A by more than that.
    """
    margin = None if fail_if_worse is None else _margin(fail_if_worse)
    from navfw.config.input_file import is_folder
    from navfw.suite.paired_comparison import compare_tables, of_variant
    from navfw.suite.run_table import read_table
    from navfw.suite.suite_folder import SuiteFolder

    first, second = (
        SuiteFolder(path).rows() if is_folder(path) else read_table(path) for path in (a, b)
    )
    try:
        found = compare_tables(of_variant(first, variant_a), of_variant(second, variant_b))
    except InputError as error:
        raise InputError(f"{a}, {b}: {error}") from None
    reports = [SuiteFolder(path).report if is_folder(path) else path for path in (a, b)]
    if json:
        print_json({**found, "reports": [str(file) for file in reports]})
    else:
        _print_comparison(found)
        typer.echo(f"reports    {reports[0]}, {reports[1]}")
    fallen = (len(found["lost"]) - len(found["gained"])) / found["pairs"]
    if margin is not None and fallen > margin + 1e-9:
        what = f"success fell by {_percent(fallen)}, more than {_percent(margin)}"
        print_status(f"navfw: {what}")
        raise typer.Exit(1)


def _margin(text: str) -> float:
    """A share from ``1%`` or ``0.01``.

    Raises:
        InputError: it is neither, or outside of 0 to 100 %.

    """
    number, percent = text.removesuffix("%").strip(), text.endswith("%")
    try:
        share = float(number) / (100.0 if percent else 1.0)
    except ValueError:
        share = math.nan
    if not 0.0 <= share <= 1.0:
        what = f"expected a share of the runs such as 1% or 0.01, got {text!r:.40}"
        raise InputError(what, key="--fail-if-worse")
    return share


def _print_comparison(found: dict[str, Any]) -> None:
    from navfw.suite.paired_comparison import comparison_rows

    typer.echo(f"{found['pairs']} pairs, {found['unpaired']} unpaired runs")
    rows = comparison_rows(found)
    width = max(10, *(len(name) for name, *_ in rows))
    for name, a, b, difference in rows:
        typer.echo(f"{name:<{width}} {a} -> {b}" + (f"  ({difference})" if difference else ""))
    for word in ("lost", "worse", "gained", "better"):
        for run in found[word][:MAX_SHOWN]:
            where = f"{run['entry']} / {run['world']} / {run['mission']}, seed {run['seed']}"
            if "by_configuration" in found:
                where += f", {run['variant'] or run['stack']}"
            reached = word in {"worse", "better"}
            why = f"SPL {run['spl']:.2f}" if reached else f"{run['outcome']}: {run['cause']}"
            typer.echo(f"  {word}: {where} ({why}) {run['picture']}".rstrip())
        if len(found[word]) > MAX_SHOWN:
            typer.echo(f"  {word}: and {len(found[word]) - MAX_SHOWN} more")


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
