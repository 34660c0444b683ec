"""Recovery of a damaged journal: what is intact is kept, the damaged file is moved aside."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from navfw.errors import InputError
from navfw.suite.run_journal import JournalDamagedError, RunJournal
from navfw.suite.run_table import RunRow


def ready_journal(
    journal: RunJournal, contents: dict[tuple[str, ...], str], exported: Sequence[RunRow]
) -> str:
    """Make ``journal`` usable; returns what was done, in a sentence, or "" for an intact one.

    A damaged journal is moved aside, and its intact rows go to a new one. ``exported`` are the rows
    of the table beside it: those that no journal has are kept as well, if ``contents`` has the
    content of their runs (by ``RunRow.setting``).

    Raises:
        InputError: the journal is of a newer version, or the folder cannot be written.

    """
    file, told = journal.file, ""
    kept: list[tuple[str, RunRow]] = []
    try:
        if file.exists():
            journal.check()
            kept = journal.all_rows()
            if kept:
                return ""
    except JournalDamagedError as error:
        kept = journal.intact()
        aside = _moved_aside(file)
        told = f"{error}; it is kept as {aside.name}. "
    journal.create()
    known = {row.key for _, row in kept}
    kept += [
        (contents[row.setting], row)
        for row in exported
        if row.key not in known and row.setting in contents
    ]
    journal.add_all(kept)
    if not told and not kept:
        return ""
    told = told or f"{file}: there is no journal beside the table. "
    return f"{told}{len(kept)} finished runs are intact and kept; all others are driven again"


def _moved_aside(file: Path) -> Path:
    """Rename a damaged journal, with SQLite's own file of its last transaction."""
    try:
        for number in itertools.count(1):
            aside = file.with_name(f"{file.stem}-damaged-{number}{file.suffix}")
            if not aside.exists():
                rest = file.with_name(f"{file.name}-journal")
                if rest.exists():
                    rest.rename(aside.with_name(f"{aside.name}-journal"))
                return file.rename(aside)
    except OSError as error:
        what = f"is damaged, and cannot be renamed: {error.strerror or error}"
        raise InputError(what, file=file) from None
    raise AssertionError("numbers have no end")
