"""``navfw suite``: runs missions with many seeds and collects the results in one table."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from navfw.cli import options
from navfw.cli.options import complete_setting, completer_of
from navfw.cli.output import echo, print_json, print_table, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.cli.warm import compile_with_progress
from navfw.process.interruption import deferred, interruptible
from navfw.recording.run_folder import plain_json

if TYPE_CHECKING:
    from navfw.suite.case import Case
    from navfw.suite.run_row import RunRow
    from navfw.suite.suite_folder import StartMode
    from navfw.suite.suite_plan import SuitePlan
    from navfw.suite.suite_run import SuiteResult

MAX_SHOWN = 25
"""Largest number of failed runs to print; the table has all."""


Keep = Literal["all", "failed", "none"]
"""The runs whose pictures, or recordings, are kept."""
Seeds = Annotated[str, typer.Option(metavar="A:B", help="Seeds from A to B - 1.")]
_SuiteOut = Annotated[
    Path | None, typer.Option(help="Folder for the table [default: runs/SUITE-A-B].")
]
Stacks = Annotated[
    list[str] | None,
    typer.Option(
        help="Name or file of a stack, instead of those of the suite. May be repeated.",
        autocompletion=completer_of("stack"),
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="K=V",
        help="Change one value in all runs. May be repeated.",
        autocompletion=complete_setting,
    ),
]
Worlds = Annotated[
    Path | None, typer.Option(help="Folder of worlds, instead of those of the suite.")
]
Variants = Annotated[
    list[str] | None, typer.Option(help="Run only this variant of the suite. May be repeated.")
]
_KeepPictures = Annotated[Keep, typer.Option(help="Runs whose trajectory picture is kept.")]
Recorded = Annotated[
    Keep, typer.Option("--record", help="Runs whose recording is kept, for a report.")
]
"""Not with Dask: recordings stay where the run was driven."""
_Extend = Annotated[
    bool,
    typer.Option("--extend", help="Continue a suite that was changed; keep runs still valid."),
]
Restart = Annotated[
    bool, typer.Option("--restart", help="Begin again; earlier results go to OUT/before-N.")
]

_Power = Annotated[
    str | None,
    typer.Option(
        metavar="PERCENT",
        help="Run nothing: how many seeds show this difference of success, given runs in --out.",
    ),
]


def suite(
    file: options.Suite,
    seeds: Seeds,
    workers: options.Workers = 1,
    out: _SuiteOut = None,
    stack: Stacks = None,
    robot: options.Robot = None,
    set_: Overrides = None,
    worlds: Worlds = None,
    variant: Variants = None,
    keep: _KeepPictures = "failed",
    record: Recorded = "none",
    limit: options.Limit = 900.0,
    memory: options.Memory = 2000.0,
    engine: options.EngineName = "processes",
    scheduler: options.Scheduler = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the suite in --out.")] = False,
    extend: _Extend = False,
    restart: Restart = False,
    power: _Power = None,
    json: options.Json = False,
    quiet: Quiet = False,
) -> None:
    """Run a suite with many seeds. Exit with 1 when runs have no result or plugins failed.

    Exit with 3 if the table could not be written; the runs are printed anyway.
    """
    if power is not None:
        _print_power(file, power, out, json=json)
        return
    _check_engine(engine, scheduler, record)
    begin = _beginning(out, resume=resume, extend=extend, restart=restart)
    with quiet_stdout():
        from navfw.recording.provenance import code_revision
        from navfw.suite.suite_folder import SuiteFolder
        from navfw.suite.suite_run import engine_for, run_suite
        from navfw.suite.suitefile import parse_seeds

        span = parse_seeds(seeds)
        changes = [*options.of_robot(robot), *(set_ or [])]
        choice = {"stacks": stack or [], "overrides": changes, "variants": variant or []}
        plan = _checked_plan(file, span, worlds, choice, quiet=quiet)
    with deferred():  # from here on there are runs to save and to print
        with (
            quiet_stdout(),
            engine_for(plan.cases, scheduler, workers, limit, memory) as runner,
            SuiteFolder.claim(out, plan, span) as folder,
        ):
            have = folder.open(plan, code_revision(), begin=begin, tell=_print_note)
            if scheduler is None:
                with interruptible():  # workers would wait for it in silence
                    compile_with_progress(loaded=True, quiet=quiet)
            with ProgressBar(plan.suite, "runs", quiet=quiet, moving=True) as bar:
                count = _counted(bar, plan, have)
                drive = partial(run_suite, keep=keep, record=record, have=have, on_row=count)
                done = drive(plan, folder, runner)
        _print_result(done, folder.table, json=json)
        raise typer.Exit(done.exit_code)


def _check_engine(engine: options.EngineKind, scheduler: str | None, record: Keep) -> None:
    if engine == "dask" and record != "none":
        what = "is not for --engine dask; drive the run again alone: navfw run --record"
        raise typer.BadParameter(what, param_hint="--record")
    options.check_engine(engine, scheduler)


def _print_power(file: str, text: str, out: Path | None, *, json: bool) -> None:
    """How many seeds a comparison of two stacks needs on a suite, for a difference of success."""
    try:
        difference = float(text.removesuffix("%")) / 100.0
    except ValueError:
        difference = 0.0
    if not 0.001 <= difference <= 0.5:
        raise typer.BadParameter(f"expected 0.1% to 50%, got {text!r}", param_hint="--power")
    with quiet_stdout():
        from navfw.suite.paired_comparison import mcnemar_pairs
        from navfw.suite.suite_folder import SuiteFolder
        from navfw.suite.suite_plan import case_templates
        from navfw.suite.suitefile import load_suite

        loaded = load_suite(file)
        rows = [] if out is None else SuiteFolder(out).rows()
        per_seed = sum(len(case_templates(loaded, n)) for n in range(len(loaded.spec.entries)))
    rate = sum(row.succeeded for row in rows) / len(rows) if rows else 0.9
    other = max(rate - difference, 0.0)
    apart = rate * (1.0 - other) + other * (1.0 - rate)
    needed: list[dict[str, Any]] = [
        {"what": what, "share": share, "pairs": pairs, "seeds": -(-pairs // per_seed)}
        for share, what in ((apart, "runs of a seed independent"), (0.5 * apart, "half of that"))
        if (pairs := mcnemar_pairs(difference, share))
    ]
    if json:
        print_json({"success": rate, "runs": len(rows), "difference": difference, "needs": needed})
        return
    source = f"of {len(rows)} runs in {out}" if rows else "assumed; --out FOLDER takes that of runs"
    echo(f"success {100.0 * rate:.1f} % ({source}), difference {100.0 * difference:g} %")
    for need in needed:
        echo(
            f"{need['seeds']} seeds: {need['pairs']} pairs, {100.0 * need['share']:.1f} % with one"
            f" success ({need['what']}); McNemar, 5 %, power 80 %"
        )


def _print_note(text: str) -> None:
    echo(f"navfw: {text}", err=True)


def _checked_plan(
    file: str, seeds: range, worlds: Path | None, choice: dict[str, list[str]], *, quiet: bool
) -> SuitePlan:
    """Return the runs of a suite, checked; ``choice`` has stacks, overrides and variants."""
    from navfw.plugins import default_registry
    from navfw.suite.suite_plan import plan_runs
    from navfw.suite.suitefile import load_suite

    with ProgressBar("checking", "missions", quiet=quiet) as bar:
        checked: Callable[..., SuitePlan] = partial(plan_runs, worlds=worlds, progress=bar.update)
        plan = checked(load_suite(file), seeds, default_registry(), **choice)
    for name, reason in plan.skipped.items():
        _print_note(f"variant {name} skipped: {reason}")
    return plan


def _beginning(out: Path | None, *, resume: bool, extend: bool, restart: bool) -> StartMode:
    options: dict[StartMode, bool] = {"resume": resume, "extend": extend, "restart": restart}
    modes = [mode for mode, is_given in options.items() if is_given]
    if len(modes) > 1:
        raise typer.BadParameter(f"cannot go with --{modes[1]}", param_hint=f"--{modes[0]}")
    if modes and out is None:
        what = f"needs --out, the folder to {modes[0]}"
        raise typer.BadParameter(what, param_hint=f"--{modes[0]}")
    return modes[0] if modes else "new"


def _print_result(done: SuiteResult, table: Path, *, json: bool) -> None:
    from navfw.suite.run_row import columns_of, table_cells

    if json:
        columns = columns_of(done.rows)
        runs = [{name: getattr(row, name) for name in columns} for row in done.rows]
        print_json(plain_json({"summary": {**done.summary, "table": str(table)}, "runs": runs}))
    else:
        _print_summary(done.summary, done.rows)
        if done.unsaved:
            csv.writer(sys.stdout, lineterminator="\n").writerows(table_cells(done.rows))
        else:
            echo(f"table: {table}")
    if done.unsaved:
        _print_note(f"{done.unsaved}; all runs are on stdout")


def _print_summary(summary: dict[str, Any], rows: tuple[RunRow, ...]) -> None:
    from navfw.suite.suite_summary import summary_table

    table = summary_table(summary)
    print_table(table.head, table.rows, "No runs.")
    for cause, count in summary["causes"].items():
        seeds = [row.seed for row in rows if row.failure == cause]
        some = ", ".join(map(str, seeds[:8])) + (", ..." if len(seeds) > 8 else "")
        echo(f"{count:5d} x {cause:<28} seeds {some}")
    failed = [row for row in rows if not row.succeeded]
    for row in failed[:MAX_SHOWN]:
        run = f"{row.entry} / {row.world} / {row.mission}, seed {row.seed}, {row.configuration}"
        echo(f"  {run}: {row.outcome} ({row.cause}): {row.reason}")
    if len(failed) > MAX_SHOWN:
        echo(f"  and {len(failed) - MAX_SHOWN} more")
    if not summary["complete"]:
        echo("interrupted; --resume runs the rest")
    if died := summary["died"]:
        echo(f"{died} {'run' if died == 1 else 'runs'} died; --resume runs them again")
    if faults := summary["plugin_faults"]:
        echo(f"plugins failed often ({faults}); see plugin_faults")


def _counted(
    bar: ProgressBar, plan: SuitePlan, have: list[RunRow]
) -> Callable[[Case, RunRow], None]:
    """What counts a finished run, and shows how many have reached their goals."""
    keys = {case.key for case in plan.cases}
    finished = [row for row in have if row.key in keys and row.has_result]
    done, reached = len(finished), sum(row.succeeded for row in finished)
    bar.update(done, len(keys))

    def count(case: Case, row: RunRow) -> None:
        del case
        nonlocal done, reached
        done, reached = done + 1, reached + row.succeeded
        bar.update(done, len(keys), f"{reached} reached ({100.0 * reached / done:.1f} %)")

    return count
