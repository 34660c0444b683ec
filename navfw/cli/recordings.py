"""``navfw report`` of recorded runs and suites; and the option ``--video``.

A report is one HTML file about a run or a suite that needs no network. Two suites are compared run
by run, also as text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from navfw.cli.options import (
    argument,
    option,
)
from navfw.cli.output import echo, print_json, quiet_stdout
from navfw.cli.progress_bar import ProgressBar, Quiet
from navfw.config.input_file import is_file
from navfw.config.lookup import find
from navfw.errors import InputError, locating
from navfw.process.atomic import output_file, write_text
from navfw.process.result_table import shown
from navfw.recording.run_folder import RECORDING, REPORT, RESULT, read_result

if TYPE_CHECKING:
    from navfw.suite.suite_folder import SuiteFolder

VIDEO = "--video"
"""The name of the option, for messages."""


def write_video(folder: Path, target: Path, *, quiet: bool) -> None:
    """Write the recording in a run folder as a video, and print its path on stderr.

    Raises:
        InputError: the recording is damaged, or the video cannot be written.

    """
    from navfw.report.run_video import CHASE_SIZE, write_run_video

    with ProgressBar("video", "pictures", quiet=quiet) as bar:
        write_run_video(folder, target, VIDEO, bar.update, chase_of(folder, CHASE_SIZE, fine=2))
    if not quiet:
        echo(f"video: {target}", err=True)


def chase_of(folder: Path, size: tuple[int, int] = (480, 270), fine: int = 1) -> Any:
    """Return ``ChaseView(..., size, fine).draw`` of a run; None without simulator or world."""
    result = read_result(folder)
    try:
        from navfw.robot import RobotModel
        from navfw.sim import load_world
        from navfw.sim.chase_view import ChaseView

        world = load_world(find("world", str(result["world"])))
        robot = RobotModel.model_validate(result["config"]["mission"]["robot"])
    except (InputError, LookupError, TypeError, ValueError):
        return None
    return ChaseView(world, robot, size, fine).draw


Variants = tuple[str | None, str | None]
"""The variants of A and B to compare; None: all of them."""

MAX_SHOWN = 25
"""Largest number of runs to print of each kind; ``--json`` has all."""


def report(
    folder: list[Path] = argument(
        ...,
        "Folder of a run or of a suite; or of two suites, which are compared.",
        metavar="RUN|SUITE...",
    ),
    out: Path | None = option(
        None,
        "File to write [default: report.html in the folder; comparison.html in that of the second"
        " suite].",
    ),
    variant_a: str | None = option(None, "Use only this variant of A."),
    variant_b: str | None = option(None, "Use only this variant of B."),
    fail_if_worse: str | None = option(
        None, "Two suites: exit with 1 if success fell by more, as 1%.", metavar="SHARE"
    ),
    text: bool = option(False, "Compare two suites without a page.", "--text"),
    json: bool = option(False, "As --text, but print one JSON object with all runs.", "--json"),
    quiet: Quiet = False,
) -> None:
    """Write a report of a run or of a suite, or compare two suites.

    A report is one HTML file. Two suites are compared run by run; the comparison is also printed,
    the worst regressions first. Recorded runs of a suite get their own reports, if they have
    none yet.
    """
    variants = (variant_a, variant_b)
    _check_options(
        len(folder),
        {"--variant-a": variant_a, "--variant-b": variant_b, "--fail-if-worse": fail_if_worse}
        | {"--text": text, "--json": json},
    )
    if out is not None and (text or json):
        what = "is for the page, which --text and --json leave out"
        raise typer.BadParameter(what, param_hint="--out")
    margin = None if fail_if_worse is None else _margin(fail_if_worse)
    comparison: dict[str, Any] | None = None
    if text or json:
        comparison = _compare(folder, variants)
    else:
        with quiet_stdout(), ProgressBar("report", "recorded runs", quiet=quiet) as bar:
            target, notes = _write(folder, variants, out, bar)
            comparison = _compare(folder, variants) if len(folder) == 2 else None
        for what in notes:
            echo(f"navfw: left out: {what}", err=True)
    if comparison is not None:
        (print_json if json else _print_comparison)(comparison)
    if not (text or json):
        echo(f"report: {target}")
    if comparison is not None and margin is not None:
        _exit_if_worse(comparison, margin)


def _check_options(folders: int, for_two: Mapping[str, object]) -> None:
    """Raise typer.BadParameter for too many folders, or for an option that needs two of them."""
    if folders > 2:
        raise typer.BadParameter("at most two folders", param_hint="RUN|SUITE...")
    for name, value in for_two.items():
        if folders < 2 and value:
            raise typer.BadParameter("needs two suites to compare", param_hint=name)


def _compare(paths: list[Path], variants: Variants) -> dict[str, Any]:
    """Return the comparison of two suites' folders, as plain data."""
    from navfw.suite.paired_comparison import compare_tables, of_variant
    from navfw.suite.suite_folder import SuiteFolder

    suites = [SuiteFolder(path) for path in paths]
    tables = [suite.rows() for suite in suites]
    with locating(file=", ".join(map(str, paths))):
        comparison = compare_tables(
            *(of_variant(rows, name) for rows, name in zip(tables, variants, strict=True))
        )
    return {**comparison, "reports": [str(suite.report) for suite in suites]}


def _write(
    folders: list[Path], variants: Variants, out: Path | None, bar: ProgressBar
) -> tuple[Path, list[str]]:
    """Write the report; returns its file, and what is wrong with pictures and recordings."""
    if len(folders) > 1 or not is_file(folders[0] / RESULT):
        return _write_of_suites(folders, variants, out, bar)
    from navfw.report.run_page import run_report  # it needs no simulator, those of suites do

    target = out or folders[0] / REPORT
    output_file(target, "--out")
    write_text(target, run_report(folders[0], chase_of(folders[0])))
    return target, []


def _write_of_suites(
    folders: list[Path], variants: Variants, out: Path | None, bar: ProgressBar
) -> tuple[Path, list[str]]:
    """Write the report of one suite or of two, and those of their recorded runs."""
    from navfw.report.suite_page import comparison_report, suite_report
    from navfw.suite.suite_folder import COMPARISON, SuiteFolder

    suites = [SuiteFolder(folder) for folder in folders]
    of_run = [is_file(folder / RESULT) for folder in folders]
    for folder, is_run, suite in zip(folders, of_run, suites, strict=True):
        if not is_run and not suite.has_runs:
            what = f"is neither the folder of a run (it has no {RESULT}) nor of a suite (it has no"
            raise InputError(f"{what} journal.sqlite)", file=folder)
    target = out or folders[-1] / (REPORT if len(folders) == 1 else COMPARISON)
    output_file(target, "--out")
    if any(of_run):
        what = "is the folder of a run; two suites can be compared"
        raise InputError(what, file=folders[of_run.index(True)])
    text, notes = (
        suite_report(suites[0], target.parent)
        if len(suites) == 1
        else comparison_report(suites[0], suites[1], target.parent, variants)
    )
    for suite in suites:
        notes += _write_run_reports(suite, bar)
    write_text(target, text)
    return target, notes


def _write_run_reports(suite: SuiteFolder, bar: ProgressBar) -> list[str]:
    """Write the reports of recorded runs that have none; returns what is wrong with recordings."""
    from navfw.report.run_page import run_report

    folders = [
        folder
        for row in suite.rows()
        if is_file((folder := suite.recording(row)) / RECORDING) and not is_file(folder / REPORT)
    ]
    wrong = []
    for number, folder in enumerate(folders):
        bar.update(number, len(folders), folder.name)
        try:
            write_text(folder / REPORT, run_report(folder, chase_of(folder)))
        except InputError as error:
            wrong.append(str(error))
    return wrong


def _exit_if_worse(comparison: Mapping[str, Any], margin: float) -> None:
    """Exit with 1 if B succeeds more rarely than A by more than ``margin``, a share of the runs."""
    fallen = (len(comparison["lost"]) - len(comparison["gained"])) / comparison["pairs"]
    if fallen > margin + 1e-9:
        fell, allowed = shown(fallen, ".1%"), shown(margin, ".1%")
        echo(f"navfw: success fell by {fell}, more than {allowed}", err=True)
        raise typer.Exit(1)


def _margin(text: str) -> float:
    """Return a share, in [0, 1], from ``1%`` or ``0.01``."""
    number, percent = text.removesuffix("%").strip(), text.endswith("%")
    try:
        share = float(number) / (100.0 if percent else 1.0)
    except ValueError:
        share = math.nan
    if not 0.0 <= share <= 1.0:
        what = f"expected a share of the runs such as 1% or 0.01, got {text!r:.40}"
        raise InputError(what, key="--fail-if-worse")
    return share


def _print_comparison(comparison: dict[str, Any]) -> None:
    from navfw.suite.paired_comparison import comparison_rows

    echo(f"{comparison['pairs']} pairs, {comparison['unpaired']} unpaired runs")
    rows = comparison_rows(comparison)
    width = max(10, *(len(name) for name, *_ in rows))
    for name, a, b, difference in rows:
        echo(f"{name:<{width}} {a} -> {b}" + (f"  ({difference})" if difference else ""))
    for word in ("lost", "worse", "gained", "better"):
        for run in comparison[word][:MAX_SHOWN]:
            where = f"{run['entry']} / {run['world']} / {run['mission']}, seed {run['seed']}"
            if "by_configuration" in comparison:
                where += f", {run['variant'] or run['stack']}"
            reached = word in {"worse", "better"}
            why = f"SPL {run['spl']:.2f}" if reached else f"{run['outcome']}: {run['cause']}"
            echo(f"  {word}: {where} ({why}) {run['picture']}".rstrip())
        if len(comparison[word]) > MAX_SHOWN:
            echo(f"  {word}: and {len(comparison[word]) - MAX_SHOWN} more")
    echo(f"reports    {', '.join(comparison['reports'])}")
