"""Output of the commands: JSON and tables; streams that fail give no traceback.

``navfw list worlds > /dev/full`` ends with a message and exit code 1, ``navfw list worlds | head
-0`` with exit code 1, and with a closed standard output everything runs without it.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from navfw.process.printable_text import printable
from navfw.process.process_resources import redirected

if TYPE_CHECKING:
    from navfw.process.result_table import ResultTable

ItemT = TypeVar("ItemT")


class _PrintableStream:
    """A text stream that makes what is written ``printable``; ``unfiltered`` is the stream.

    Its ``encoding`` lets click write to it, not to the bytes below it.
    """

    encoding = "utf-8"

    def __init__(self, unfiltered: Any) -> None:
        self.unfiltered = unfiltered

    def write(self, text: str) -> int:
        self.unfiltered.write(printable(text, cut=True))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unfiltered, name)


@contextlib.contextmanager
def printable_output() -> Iterator[None]:
    """Make all text printable that is written to stdout and stderr inside the block."""
    with (
        contextlib.redirect_stdout(_PrintableStream(sys.stdout)),
        contextlib.redirect_stderr(_PrintableStream(sys.stderr)),
    ):
        yield


def _unfiltered(stream: Any) -> Any:
    return getattr(stream, "unfiltered", stream)


def print_json(data: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> None:
    """Print one object, or a list of objects, on stdout: in ASCII, in lines of any length."""
    typer.echo(json.dumps(data, indent=2, allow_nan=False), file=_unfiltered(sys.stdout))


def print_result(data: Mapping[str, Any], lines: Iterable[str], *, json: bool) -> None:
    """Print one object with ``json``, otherwise the ``lines``."""
    if json:
        print_json(data)
    else:
        typer.echo("\n".join(lines))


def print_json_list(items: Iterable[Mapping[str, Any]]) -> None:
    """Print a list of objects on stdout, a line for each as soon as there is one.

    The list is closed as well when ``items`` raises: what was printed stays valid JSON.
    """
    opening = "["
    try:
        for item in items:
            line = opening + json.dumps(item, allow_nan=False)
            typer.echo(line, file=_unfiltered(sys.stdout))
            opening = ","
    finally:
        if opening == ",":
            typer.echo("]")
    if opening == "[":
        typer.echo("[]")


def quietly(items: Iterable[ItemT]) -> Iterator[ItemT]:
    """The ``items``; while each is made, stdout is redirected as by ``quiet_stdout``."""
    iterator = iter(items)
    while True:
        with quiet_stdout():
            item = next(iterator, None)
        if item is None:
            return
        yield item


@contextlib.contextmanager
def quiet_stdout() -> Iterator[None]:
    """Redirect stdout to stderr inside the block, for native libraries as well.

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
    """A rich console on stdout, 160 columns wide where that is no terminal, or on stderr.

    Text is made ``printable``; only the styles of rich become escapes.
    """
    from rich.console import Console, ConsoleOptions, RenderHook
    from rich.segment import Segment

    class Printable(RenderHook):
        def __init__(self, inner: Any = None) -> None:
            self.inner = inner

        def process_renderables(self, renderables: list[Any]) -> list[Any]:
            return [Printable(renderable) for renderable in renderables]

        def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
            for text, style, control in console.render(self.inner, options):
                yield Segment(text if control else printable(text), style, control)

    stream = sys.stderr if stderr else sys.stdout
    width = None if stderr or stream.isatty() else 160
    made = Console(file=_unfiltered(stream), highlight=False, width=width)
    made.push_render_hook(Printable())
    return made


def print_table(columns: Sequence[str], rows: Sequence[Sequence[object]], nothing: str) -> None:
    """Print a table on stdout, or the text ``nothing`` when there are no rows."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    if not rows:
        typer.echo(nothing)
        return
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    # as Text: rich would read a unit such as [m] as markup
    for title in columns:
        table.add_column(Text(title))
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(str(cell)) for cell in row))
    console().print(table)


def print_tables(tables: Iterable[ResultTable]) -> None:
    """Print tables with their titles on stdout."""
    for table in tables:
        typer.echo(f"\n{table.title}")
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
    """Run the block with usable standard streams; exit with 1 if the output cannot be written."""
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
        for descriptor in _OUTPUTS:  # the interpreter's last flush succeeds, and goes nowhere
            _to_null(descriptor)
        sys.exit(1)


def _replace_closed() -> None:
    """Give closed outputs a descriptor, so that no file that is opened later gets theirs."""
    for descriptor, name in zip(_OUTPUTS, ("stdout", "stderr"), strict=True):
        try:
            os.fstat(descriptor)
        except OSError:
            _to_null(descriptor)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.dup(descriptor), "w", encoding="utf-8"))


def _to_null(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != descriptor:
        os.dup2(nowhere, descriptor)
        os.close(nowhere)


NOT_SAVED = 3
"""Exit code of a finished drive whose run folder could not be written completely."""


def show_result(summary: Mapping[str, Any], missing: Sequence[str], as_json: bool) -> None:
    """Print the result of a run on stdout, and on stderr what its folder lacks.

    The result of a run that was ended from outside has the first few keys only.
    """
    if as_json:
        print_json(summary)
    elif "command_hash" in summary:
        _print_result(summary)
    else:
        typer.echo(f"{summary['outcome']}: {summary['reason']}")
    if not missing:
        return
    for what in missing:
        typer.echo(f"navfw: {what}", err=True)
    folder = summary["run_folder"]
    names = [] if folder is None else sorted(file.name for file in Path(folder).iterdir())
    saved = f"{', '.join(names)} in {folder}" if names else "nothing; the result is on stdout"
    typer.echo(f"navfw: saved: {saved}", err=True)


def _print_result(summary: Mapping[str, Any]) -> None:
    objections = summary["objections"]
    good = summary["outcome"] == "reached" and not objections
    leader = f" (leading behaviour {summary['behavior']})" if summary["behavior"] else ""
    screen = console()
    screen.print(
        f"[bold {'green' if good else 'red'}]{summary['outcome']}[/] after"
        f" {summary['sim_time_s']:.1f} s",
        end=", but " if objections else ": ",
    )
    if objections:
        screen.print("; ".join(objections), markup=False, soft_wrap=True, end=": ")
    screen.print(f"{summary['reason']}{leader}", markup=False)
    count = summary["collisions"]
    collisions = f"{count or 'no'} collision{'' if count == 1 else 's'}"
    nearest = summary["min_clearance_m"]
    clearance = "no obstacle near" if nearest is None else f"at least {nearest:.2f} m"
    rows = {
        "path": f"{summary['path_length_m']:.2f} m, shortest {summary['shortest_path_m']:.2f} m"
        f" (SPL {summary['spl']:.2f})",
        "clearance": f"{clearance}, {collisions}",
        "goal": f"{summary['distance_to_goal_m']:.2f} m away, error of the estimated position"
        f" {summary['estimate_error_m']:.2f} m",
        "speed": f"{summary['real_time_factor']:.1f} x real time ({summary['wall_time_s']:.1f} s)",
        "commands": summary["command_hash"][:16],
        "run folder": summary["run_folder"] or "none, the result could not be written",
    }
    for name, text in rows.items():
        screen.print(f"  {name:<11} {text}", markup=False, soft_wrap=True)
    for fault in summary["faults"]:
        screen.print(f"  fault       {fault}", markup=False, soft_wrap=True)
