"""The folder of a suite's results: table, summary, configuration, pictures and reports.

``journal.sqlite`` has every run that has ended (``navfw.suite.run_row``); rows are read only
from it. ``table.csv``, one row per run, is exported from it, ``summary.json`` is the summary,
``table.md`` the summary as Markdown.
``suite.json`` identifies worlds, missions and stacks, so that an interrupted suite is continued
with the same ones only.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from navfw.config.input_file import is_file, is_folder, read_json_object
from navfw.errors import ConfigError, InputError
from navfw.process.atomic import output_place, write_text, writing
from navfw.process.target_lock import TargetInUseError, TargetLock, sweep
from navfw.recording.provenance import machine_kind
from navfw.recording.run_folder import REPORT, plain_json
from navfw.suite.case import BESIDE, RECORDINGS
from navfw.suite.run_row import RunJournal, RunRow, table_cells
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_summary import brief_table

if TYPE_CHECKING:
    from navfw.suite.suite_frame import SuiteFrame

TABLE, SUMMARY, _ABOUT, _PICTURES = "table.csv", "summary.json", "suite.json", "pictures"
_MARKDOWN, _JOURNAL = "table.md", "journal.sqlite"
COMPARISON = "comparison.html"
"""File name of the report that compares two suites, in the folder of the second."""

StartMode = Literal["new", "resume", "extend", "restart"]
"""How a suite starts: in an empty folder; keeping the finished runs; keeping those that a change of
the suite does not concern; from the beginning, with the earlier results moved aside."""

_OWN = (TABLE, SUMMARY, _MARKDOWN, _ABOUT, _PICTURES, _JOURNAL, *BESIDE, REPORT, COMPARISON)
_BEFORE = "before-"
"""Beginning of the names of the folders of earlier results."""


@dataclass(frozen=True)
class SuiteFolder:
    """The folder of a suite's results; ``claim`` creates and locks it, ``open`` fills it."""

    path: Path

    @property
    def table(self) -> Path:
        """The file of the table, one row per run."""
        return self.path / TABLE

    @property
    def journal(self) -> RunJournal:
        """The journal of all runs that have ended."""
        return RunJournal(self.path / _JOURNAL)

    @property
    def lock(self) -> TargetLock:
        """The lock on the folder; its file is inside, as the parent folder may be read-only."""
        return TargetLock(self.path.absolute() / "suite")

    @property
    def pictures(self) -> Path:
        """The folder of the runs' pictures."""
        return self.path / _PICTURES

    @property
    def report(self) -> Path:
        """The file to show a person: the page of ``navfw report``, ``table.md``, or the table."""
        files = (self.path / name for name in (REPORT, _MARKDOWN, TABLE))
        return next((file for file in files if is_file(file)), self.path)

    @property
    def has_runs(self) -> bool:
        """Whether a suite has written runs here."""
        return is_file(self.journal.file) or is_file(self.table)

    def recording(self, row: RunRow) -> Path:
        """Return the folder of the recording of ``row``; it exists only if the suite kept it."""
        name = row.key.file_name(generated=bool(row.family))
        return self.path / RECORDINGS / name

    @classmethod
    @contextlib.contextmanager
    def claim(cls, chosen: Path | None, plan: SuitePlan, seeds: range) -> Iterator[SuiteFolder]:
        """Create and lock the folder ``chosen``, or the first free ``runs/SUITE-A-B``, ``...-2``.

        Files that a dead process left unfinished are removed; the lock is held in this context.

        Raises:
            InputError: it cannot be written, or another process writes it.

        """
        default = Path("runs") / f"{plan.suite}-{seeds.start}-{seeds.stop}"
        with contextlib.ExitStack() as locked:
            try:
                with writing(chosen or default):
                    folder = cls(_created(chosen, default))
                    for place in (folder.path, folder.pictures):
                        sweep(place)
                    locked.enter_context(folder.lock)
            except TargetInUseError as error:
                what = "another suite is writing it; wait for it, or choose another --out"
                raise TargetInUseError(what, file=folder.path) from error
            yield folder

    def open(
        self,
        plan: SuitePlan,
        revision: str,
        *,
        begin: StartMode = "new",
        tell: Callable[[str], None] = lambda text: None,
    ) -> list[RunRow]:
        """Begin or continue the folder's files; return the rows of the plan that it has already.

        ``run_suite`` drives those of them again that ended without a result. ``tell`` is called
        with messages for the user: what was moved aside, or kept of a changed suite.

        Raises:
            InputError: the folder cannot be written, is not empty (with ``new``), or belongs to
                another suite or configuration (with ``resume``); or its journal is damaged.

        """
        if begin == "restart" and self.has_runs:
            tell(f"{self.path}: the earlier results are in {self._set_aside().name}")
        earlier: dict[str, Any] = {}
        if begin in {"resume", "extend"} and self.has_runs:
            self._check_journal()
            earlier = self.about()
            if begin == "resume":
                self._compare(earlier["content"], plan.content)
        else:
            self._refuse_foreign()
        with writing(self.path):
            self.pictures.mkdir(parents=True, exist_ok=True)
        about = {
            "suite": plan.suite,
            "suite_hash": plan.suite_hash,
            "options": plan.options,
            "content": {**plan.content},
            "current": list(dict.fromkeys(case.content for case in plan.cases)),
            "revisions": _with(earlier.get("revisions", []), revision),
            "machines": _with(earlier.get("machines", []), machine_kind()),
        }
        self._write(_ABOUT, about)  # before the journal, which cannot be read without it
        self.journal.create()
        rows = self.journal.rows(case.content for case in plan.cases)
        if earlier.get("content", plan.content) != plan.content:
            kept = sum(row.has_result for row in rows)
            tell(f"the suite was changed: {kept} finished runs are unchanged and kept")
        return rows

    def _set_aside(self) -> Path:
        """Move what an earlier suite left into the first free folder ``before-N``."""
        number = 1
        while (aside := self.path / f"{_BEFORE}{number}").exists():
            number += 1
        with writing(aside):
            aside.mkdir()
            for file in [self.path / name for name in _OWN]:
                if file.exists():
                    file.rename(aside / file.name)
        return aside

    def rows(self) -> list[RunRow]:
        """Read the rows of all runs that have ended, in the order of the plan.

        This works also while the suite runs, or after it was killed.

        Raises:
            InputError: there is no such folder, or its journal is missing or damaged.

        """
        self._check_journal()
        return self.journal.rows(self.about().get("current", []))

    def summary(self) -> dict[str, Any]:
        """Read the summary that was written last; empty if there is none yet.

        Raises:
            ConfigError: it is damaged.

        """
        file = self.path / SUMMARY
        return read_json_object(file) if is_file(file) else {}

    def save(self, rows: Sequence[RunRow], summary: Mapping[str, Any]) -> None:
        """Write ``table.csv``, ``summary.json``, ``table.md``; remove an empty picture folder."""
        write_text(self.table, table_cells(rows))
        self._write(SUMMARY, summary)
        write_text(self.path / _MARKDOWN, brief_table(summary).markdown())
        if self.pictures.is_dir() and not any(self.pictures.iterdir()):
            self.pictures.rmdir()

    def about(self) -> dict[str, Any]:
        """Read ``suite.json``: suite, its hash, options, content, revisions, machines.

        ``current`` has the fingerprints (``Case.content``) of the runs that belong to the suite
        now, in the order of its plan.

        Raises:
            ConfigError: there is no such file, or it is damaged.

        """
        file = self.path / _ABOUT
        try:
            about = read_json_object(file)
        except ConfigError as error:
            what = f"{error}; without it the table beside it cannot be continued"
            raise ConfigError(what) from None
        if not isinstance(about.get("content"), dict):
            raise ConfigError("is not a file written by navfw suite", file=file)
        return about

    def _compare(self, earlier: Mapping[str, str], wanted: Mapping[str, str]) -> None:
        differing = [
            name for name in {**wanted, **earlier} if earlier.get(name) != wanted.get(name)
        ]
        if differing:
            what = f"belongs to another suite or configuration: {differing[0]} differs"
            more = f" (and {len(differing) - 1} more)" if len(differing) > 1 else ""
            help_ = "keep what is unchanged with --extend, begin again with --restart, or choose"
            raise InputError(f"{what}{more}; {help_} another --out", file=self.path)

    def _check_journal(self) -> None:
        if is_file(self.journal.file):
            return
        what = "has no journal.sqlite, the only file from which runs of a suite are read"
        if not is_folder(self.path):
            what = "is no folder; expected that of a suite"
        elif is_file(self.table):
            what += "; drive them again with --restart"
        raise InputError(what, file=self.path)

    def _refuse_foreign(self) -> None:
        if self.has_runs:
            what = "contains runs already: continue with --resume, begin again with --restart"
            raise InputError(f"{what}, or choose another --out", file=self.path)
        # a suite that was killed as it began leaves some of its own files, without runs
        own = {self.lock.file.name, *_OWN}
        names = {file.name for file in self.path.iterdir()} if is_folder(self.path) else set()
        if any(not name.startswith(_BEFORE) for name in names - own):
            raise InputError("is not empty; choose another --out", file=self.path)

    def _write(self, name: str, value: Mapping[str, Any]) -> None:
        text = json.dumps(plain_json(value), indent=2, allow_nan=False)
        write_text(self.path / name, text + "\n")


def _with(values: list[Any], value: object) -> list[Any]:
    return values if value in values else [*values, value]


def _created(chosen: Path | None, default: Path) -> Path:
    """The folder ``chosen``, created if it is not there, or the first free one by ``default``."""
    if chosen is not None:
        place = output_place(chosen, "--out", replaced=False)
        if place.exists() and not place.is_dir():
            raise InputError("is a file; a suite needs a folder", file=chosen)
        place.mkdir(parents=True, exist_ok=True)
        return chosen
    place, number = default, 1
    while True:
        with contextlib.suppress(FileExistsError):
            place.mkdir(parents=True)
            return place
        number += 1
        place = default.with_name(f"{default.name}-{number}")


def load_suite(folder: str | Path) -> SuiteFrame:
    """Read the runs in a ``folder`` of ``navfw suite`` as a pandas table, also while it runs.

    Raises:
        MissingExtraError: pandas is not installed.
        InputError: ``folder`` is not that of a suite, or its journal is damaged.

    """
    from navfw.suite.suite_frame import SuiteFrame

    return SuiteFrame.of(SuiteFolder(Path(folder)).rows())
