"""Output of the commands: JSON and tables; if a stream fails, there is no traceback.

``navfw list worlds > /dev/full`` ends with a message and exit code 1, ``navfw list worlds | head
-0`` with exit code 1; with a closed standard output everything runs without it.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from navfw.process.printable_text import printable
from navfw.process.process_resources import redirected

if TYPE_CHECKING:
    from navfw.assumption import Assumption
    from navfw.process.result_table import ResultTable

ItemT = TypeVar("ItemT")


def echo(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print a text, made ``printable``, on stdout or stderr; with a line feed if ``nl``.

    On a terminal, the rest of a line that is too long is indented below its text.
    """
    text = printable(text, cut=True)
    if (sys.stderr if err else sys.stdout).isatty():
        width = shutil.get_terminal_size().columns
        text = "\n".join(wrapped(line, width) for line in text.split("\n"))
    _write(text, err=err, nl=nl)


@contextlib.contextmanager
def above(screen: Any) -> Iterator[None]:
    """Inside the context, print terminal output above what ``screen`` shows live."""
    _live.append(screen)
    try:
        yield
    finally:
        _live.remove(screen)


_live: list[Any] = []


def _write(text: str, *, err: bool = False, nl: bool = True) -> None:
    if _live and (sys.stderr if err else sys.stdout).isatty():
        _live[-1].print(text, markup=False, soft_wrap=True, end="\n" if nl else "")
    else:
        typer.echo(text, err=err, nl=nl)


def wrapped(line: str, width: int) -> str:
    """Wrap a line at ``width`` characters, indented below its text; words stay whole.

    >>> print(wrapped("  speed      12.0 x real time", 24))
      speed      12.0 x real
                 time
    """
    if len(line) <= width:
        return line
    begin = re.match(r" *(?:\S+(?: \S+)? {2,})?", line)
    hanging = len(begin[0]) if begin else 0
    indent = len(line) - len(line.lstrip())
    return textwrap.fill(
        line,
        width,
        subsequent_indent=" " * (hanging if indent < hanging <= width // 3 else indent + 2),
        break_long_words=False,
        break_on_hyphens=False,
    )


def print_assumed(assumed: Iterable[Assumption]) -> None:
    """Print assumptions on stderr, one line for each."""
    for assumption in assumed:
        echo(f"assumed: {assumption}", err=True)


def print_json(data: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> None:
    """Print one object, or a list of objects, on stdout: in ASCII, in lines of any length."""
    typer.echo(json.dumps(data, indent=2, allow_nan=False))


def print_result(
    data: Mapping[str, Any],
    lines: Iterable[str],
    *,
    json: bool,
    assumed: Sequence[Assumption] | None = None,
) -> None:
    """Print ``data`` as one JSON object with ``json``, otherwise the ``lines``.

    What was ``assumed``, if that can be, is printed before, and is in the object.
    """
    if assumed is not None:
        print_assumed(assumed)
        data = {**data, "assumed": [one.as_data() for one in assumed]}
    if json:
        print_json(data)
    else:
        echo("\n".join(lines))


def print_json_list(items: Iterable[Mapping[str, Any]]) -> None:
    """Print a JSON list of objects on stdout, each in a line as soon as it is there.

    If ``items`` raises, the list is closed nevertheless: what was printed is valid JSON.
    """
    opening = "["
    try:
        for item in items:
            line = opening + json.dumps(item, allow_nan=False)
            _write(line)
            opening = ","
    finally:
        if opening == ",":
            typer.echo("]")
    if opening == "[":
        typer.echo("[]")


def quietly(items: Iterable[ItemT]) -> Iterator[ItemT]:
    """Yield ``items``; while each is made, stdout is redirected as by ``quiet_stdout``."""
    iterator = iter(items)
    while True:
        with quiet_stdout():
            item = next(iterator, None)
        if item is None:
            return
        yield item


@contextlib.contextmanager
def quiet_stdout() -> Iterator[None]:
    """Context that redirects stdout to stderr, for native libraries as well.

    Stdout is reserved for results, but some libraries print when imported, and plugins may print.
    """
    with contextlib.redirect_stdout(sys.stderr):
        if not _is_fd_1(sys.__stdout__):
            yield
            return
        _flush()
        with redirected(2, 1):
            try:
                yield
            finally:
                _flush()  # the buffers of native libraries


def console(*, stderr: bool = False) -> Any:
    """Make a rich console on stdout (160 columns wide if that is not a terminal) or on stderr."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stderr or stream.isatty() else 160
    return Console(file=stream, highlight=False, width=width)


def print_table(columns: Sequence[str], rows: Sequence[Sequence[object]], nothing: str) -> None:
    """Print a table on stdout, or the text ``nothing`` if there are no rows.

    Words stay whole. If the columns do not fit the width, each row is printed as a paragraph.
    """
    from rich.box import SIMPLE_HEAD
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

    if not rows:
        echo(nothing)
        return
    # as Text: rich would read a unit such as [m] as markup
    titles, *cells = (
        [cell if isinstance(cell, Text) else Text(printable(str(cell))) for cell in row]
        for row in (columns, *rows)
    )
    screen, gap = console(), 2
    texts = (Text("\n").join(column) for column in zip(titles, *cells, strict=True))
    sizes = [Measurement.get(screen, screen.options, text) for text in texts]
    room = screen.width - sum(size.minimum + gap for size in sizes)
    if room < 0:
        _print_paragraphs([title.plain for title in titles], cells)
        return
    widths = [size.minimum for size in sizes]
    order = sorted(range(len(sizes)), key=lambda n: sizes[n].span)
    for others, n in enumerate(order):  # the narrow ones first: what they leave is for the others
        more = min(sizes[n].span, room // (len(order) - others))
        widths[n] += more
        room -= more
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, gap - 1, 0, 0))
    for title, width in zip(titles, widths, strict=True):
        table.add_column(title, width=width)
    for row in cells:
        table.add_row(*row)
    screen.print(table)


def _print_paragraphs(titles: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print each row as its first cell, and below it the others with their titles."""
    width = max(map(len, titles[1:]))
    for first, *others in rows:
        echo(first.plain)
        for title, cell in zip(titles[1:], others, strict=True):
            if cell.plain:
                echo(f"  {title:<{width}}  {cell.plain}")


def print_tables(tables: Iterable[ResultTable]) -> None:
    """Print tables with their titles on stdout."""
    for table in tables:
        echo(f"\n{table.title}")
        print_table(table.head, table.rows, "nothing")


def _is_fd_1(stream: Any) -> bool:
    try:
        return stream is not None and stream.fileno() == 1
    except (OSError, ValueError):
        return False


def _flush() -> None:
    if sys.__stdout__ is not None:
        sys.__stdout__.flush()
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).fflush(None)


_OUTPUTS = (1, 2)
"""Descriptors of standard output and standard error."""


@contextlib.contextmanager
def standard_streams() -> Iterator[None]:
    """Context with usable standard streams; exits with 1 if the output cannot be written."""
    _replace_closed()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # for terminals without Unicode
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
    except OSError as error:
        if error.filename is not None:  # a file, not a stream
            raise
        if not isinstance(error, BrokenPipeError):  # a reader that has seen enough is no failure
            with contextlib.suppress(OSError):
                sys.stderr.write(f"navfw: cannot write the output: {error.strerror}\n")
                sys.stderr.flush()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for descriptor in _OUTPUTS:  # the interpreter's last flush succeeds, and goes nowhere
            os.dup2(nowhere, descriptor)
        sys.exit(1)


def _replace_closed() -> None:
    """Give closed outputs a descriptor, so that no file that is opened later gets theirs."""
    while (spare := os.open(os.devnull, os.O_RDWR)) <= max(_OUTPUTS):
        pass
    os.close(spare)
    for descriptor, name in zip(_OUTPUTS, ("stdout", "stderr"), strict=True):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.dup(descriptor), "w", encoding="utf-8"))


NOT_SAVED = 3
"""Exit code of a finished drive whose run folder could not be written completely."""


def show_result(summary: Mapping[str, Any], missing: Sequence[str], as_json: bool) -> None:
    """Print the result of a run on stdout, and on stderr which files are missing.

    The result of a run that was ended from outside has only the first few keys.
    """
    if as_json:
        print_json(summary)
    elif "command_hash" in summary:
        _print_result(summary)
    else:
        echo(f"{summary['outcome']}: {summary['reason']}")
    if not missing:
        return
    for what in missing:
        echo(f"navfw: {what}", err=True)
    folder = summary["run_folder"]
    names = [] if folder is None else sorted(file.name for file in Path(folder).iterdir())
    saved = f"{', '.join(names)} in {folder}" if names else "nothing; the result is on stdout"
    echo(f"navfw: saved: {saved}", err=True)


_LEFT = 3
"""Number of unexplored regions that are printed."""


def _explored_rows(explored: Mapping[str, Any] | None) -> dict[str, str]:
    """What an exploration observed and left; nothing of another mission."""
    if not explored:
        return {}
    share = f"{100.0 * explored['observed_share']:.1f} % of {explored['reachable_m2']:.0f} m2"
    regions = explored["unexplored"]
    left = [f"{r['area']:.1f} m2 at ({r['x']:g}, {r['y']:g}): {r['why']}" for r in regions[:_LEFT]]
    more = [f"{len(regions) - _LEFT} more"] if len(regions) > _LEFT else []
    return {"observed": share, **({"left": "; ".join((*left, *more))} if left else {})}


def _print_result(summary: Mapping[str, Any]) -> None:
    from rich.text import Text

    from navfw.mapping import MapChange

    objections = summary["objections"]
    good = summary["outcome"] == "reached" and not objections
    leader = f" (leading behaviour {summary['behavior']})" if summary["behavior"] else ""
    but = f", but {'; '.join(objections)}" if objections else ""
    about = f" after {summary['sim_time_s']:.1f} s{but}: {summary['reason']}{leader}"
    outcome = Text(summary["outcome"], f"bold {'green' if good else 'red'}")
    screen = console()
    outcome.append(printable(about), "not bold default")
    screen.print(outcome, soft_wrap=not screen.is_terminal)
    count = summary["collisions"]
    collisions = f"{count or 'no'} collision{'' if count == 1 else 's'}"
    nearest = summary["min_clearance_m"]
    clearance = "no obstacle near" if nearest is None else f"at least {nearest:.2f} m"
    explored = summary.get("exploration")
    compared = "nearest-frontier tour" if explored else "shortest"
    cause, seen = summary.get("cause", ""), summary.get("cause_seen", "")
    rows = {
        **({"cause": f"{seen} ({cause})" if seen else cause} if cause else {}),
        "path": f"{summary['path_length_m']:.2f} m, {compared} {summary['shortest_path_m']:.2f} m"
        f" (SPL {summary['spl']:.2f})",
        **_explored_rows(explored),
        "clearance": f"{clearance}, {collisions}",
        "goal": f"{summary['distance_to_goal_m']:.2f} m away, error of the estimated position"
        f" {summary['estimate_error_m']:.2f} m",
        **({"map": summary["notes"]} if summary["notes"] and not explored else {}),
        "speed": f"{summary['real_time_factor']:.1f} x real time ({summary['wall_time_s']:.1f} s)",
        "commands": summary["command_hash"][:16],
        "run folder": summary["run_folder"] or "none, the result could not be written",
    }
    faults = [("fault", fault) for fault in summary["faults"]]
    changes = [("changed", str(MapChange(**one))) for one in summary.get("map_changes", ())]
    for name, text in (*rows.items(), *changes, *faults):
        echo(f"  {name:<11} {text}")
