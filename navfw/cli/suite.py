"""``navfw suite``: runs missions with many seeds and collects the results in one table."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from navfw.cli.options import (
    EngineName,
    Json,
    Limit,
    Memory,
    Robot,
    Scheduler,
    Suite,
    Workers,
    check_engine,
    complete_setting,
    from_options,
    of_robot,
    option,
)
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


@dataclass(frozen=True, slots=True)
class SuiteOptions:
    """Arguments and options of ``navfw suite``."""

    file: Suite
    seeds: str = option(..., "Seeds from A to B - 1.", metavar="A:B")
    workers: Workers = 1
    out: Path | None = option(None, "Folder for the table [default: runs/SUITE-A-B].")
    stack: list[str] | None = option(
        None,
        "Name or file of a stack, instead of those of the suite. May be repeated.",
        kind="stack",
    )
    robot: Robot = None
    set_: list[str] | None = option(
        None,
        "Change one value in all runs. May be repeated.",
        "--set",
        metavar="K=V",
        autocompletion=complete_setting,
    )
    worlds: Path | None = option(None, "Folder of worlds, instead of those of the suite.")
    variant: list[str] | None = option(None, "Run only this variant of the suite. May be repeated.")
    keep: Keep = option("failed", "Runs whose trajectory picture is kept.")
    record: Keep = option("none", "Runs whose recording is kept, for a report.")
    limit: Limit = 3600.0
    memory: Memory = 2000.0
    engine: EngineName = "processes"
    scheduler: Scheduler = None
    resume: bool = option(False, "Continue the suite in --out.", "--resume")
    extend: bool = option(
        False, "Continue a suite that was changed; keep runs still valid.", "--extend"
    )
    restart: bool = option(False, "Begin again; earlier results go to OUT/before-N.", "--restart")
    power: str | None = option(
        None,
        "Run nothing: how many seeds show this difference of success, given runs in --out.",
        metavar="PERCENT",
    )
    json: Json = False
    quiet: Quiet = False


@from_options
def suite(options: SuiteOptions) -> None:
    """Run a suite with many seeds. Exit with 1 when runs have no result or plugins failed.

    Exit with 3 if the table could not be written; the runs are printed anyway.
    """
    if options.power is not None:
        _print_power(options, options.power)
        return
    if options.engine == "dask" and options.record != "none":
        what = "is not for --engine dask; drive the run again alone: navfw run --record"
        raise typer.BadParameter(what, param_hint="--record")
    check_engine(options.engine, options.scheduler)
    begin = _start_mode(options)
    with quiet_stdout():
        from navfw.recording.provenance import code_revision
        from navfw.suite.suite_folder import SuiteFolder
        from navfw.suite.suite_run import engine_for, run_suite
        from navfw.suite.suitefile import parse_seeds

        seeds = parse_seeds(options.seeds)
        plan = _checked_plan(options, seeds)
    engine = options.scheduler, options.workers, options.limit, options.memory
    with deferred():  # from here on there are runs to save and to print
        with (
            quiet_stdout(),
            engine_for(plan.cases, *engine) as runner,
            SuiteFolder.claim(options.out, plan, seeds) as folder,
        ):
            have = folder.open(plan, code_revision(), begin=begin, tell=_print_note)
            if options.scheduler is None:
                with interruptible():  # workers would wait for it in silence
                    compile_with_progress(loaded=True, quiet=options.quiet)
            with ProgressBar(plan.suite, "runs", quiet=options.quiet, moving=True) as bar:
                keep = partial(run_suite, keep=options.keep, record=options.record)
                done = keep(plan, folder, runner, have=have, on_row=_counted(bar, plan, have))
        _print_result(done, folder.table, json=options.json)
        raise typer.Exit(done.exit_code)


def _print_power(options: SuiteOptions, text: str) -> None:
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

        loaded, out = load_suite(options.file), options.out
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
    if options.json:
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


def _checked_plan(options: SuiteOptions, seeds: range) -> SuitePlan:
    """Return the runs of a suite, checked."""
    from navfw.plugins import default_registry
    from navfw.suite.suite_plan import plan_runs
    from navfw.suite.suitefile import load_suite

    with ProgressBar("checking", "missions", quiet=options.quiet) as bar:
        plan = plan_runs(
            load_suite(options.file),
            seeds,
            default_registry(),
            stacks=options.stack or (),
            overrides=[*of_robot(options.robot), *(options.set_ or ())],
            variants=options.variant or (),
            worlds=options.worlds,
            progress=bar.update,
        )
    for name, reason in plan.skipped.items():
        _print_note(f"variant {name} skipped: {reason}")
    return plan


def _start_mode(options: SuiteOptions) -> StartMode:
    names: tuple[StartMode, ...] = ("resume", "extend", "restart")
    modes = [name for name in names if getattr(options, name)]
    if len(modes) > 1:
        raise typer.BadParameter(f"cannot go with --{modes[1]}", param_hint=f"--{modes[0]}")
    if modes and options.out is None:
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
