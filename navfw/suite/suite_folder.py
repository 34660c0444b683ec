"""The folder of a suite: table, summary, configuration and pictures.

``table.csv`` has one row per run, ``summary.json`` the summary, ``table.md`` the summary as
Markdown. ``suite.json`` identifies worlds, missions and stacks, so that an interrupted table is
continued with the same ones only.
"""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from navfw.atomic import output_place, write_text
from navfw.config.input_file import is_file, is_folder
from navfw.config.json_file import read_json_object
from navfw.errors import ConfigError, InputError
from navfw.recording.provenance import machine_kind
from navfw.recording.run_folder import plain_json
from navfw.suite.markdown_table import markdown_table
from navfw.suite.run_table import RunRow, read_table, write_table
from navfw.suite.suite_plan import SuitePlan
from navfw.target_lock import TargetInUseError, TargetLock, sweep

__all__ = ["SuiteFolder"]

TABLE, SUMMARY, ABOUT, PICTURES = "table.csv", "summary.json", "suite.json", "pictures"
MARKDOWN = "table.md"


@dataclass(frozen=True)
class SuiteFolder:
    """The folder of a suite's results; ``claim`` locks it, ``open`` creates or continues it."""

    path: Path

    @property
    def table(self) -> Path:
        """The file of the table, one row per run."""
        return self.path / TABLE

    @cached_property
    def lock(self) -> TargetLock:
        """The lock on the folder; inside it, as the folder above may be read-only."""
        return TargetLock(self.path.absolute() / "suite")

    @property
    def pictures(self) -> Path:
        """The folder of the runs' pictures."""
        return self.path / PICTURES

    @classmethod
    @contextlib.contextmanager
    def claim(cls, given: Path | None, plan: SuitePlan, seeds: range) -> Iterator[SuiteFolder]:
        """The folder ``given``, or the first free one of ``runs/SUITE-A-B``, ``runs/...-2``.

        It is created, cleared of what a dead process left unfinished, and locked in this context.

        Raises:
            InputError: it cannot be written, or another process writes it.

        """
        default = Path("runs") / f"{plan.suite}-{seeds.start}-{seeds.stop}"
        folder = cls(given or default)
        try:
            folder = cls(_created(given, default))
            for part in (folder.path, folder.pictures):
                sweep(part)
            folder.lock.acquire()
        except TargetInUseError as error:
            what = "another suite is writing it; wait for it, or choose another --out"
            raise TargetInUseError(what, file=folder.path) from error
        except OSError as error:
            what = f"cannot be written: {error.strerror or error}"
            raise InputError(what, file=folder.path) from error
        try:
            yield folder
        finally:
            folder.lock.release()

    def open(self, plan: SuitePlan, revision: str, *, resume: bool) -> list[RunRow]:
        """Create the folder, or continue its table with ``resume``; returns the rows in the table.

        Runs that ended without a result are left out: they are driven again.

        Raises:
            InputError: the folder cannot be written, is not empty (without ``resume``), or belongs
                to another suite or configuration.

        """
        rows: list[RunRow] = []
        revisions = [revision]
        machines = [machine_kind()]
        if resume and is_file(self.table):
            known = self.about()
            self._compare(known.get("content", {}), plan.content)
            rows = [row for row in read_table(self.table) if row.has_result]
            before = known.get("revisions", [])
            revisions = list(dict.fromkeys([*before, revision]))
            others = known.get("machines", [])
            machines = [*others, *(machine for machine in machines if machine not in others)]
        else:
            self._refuse_foreign()
        try:
            self.pictures.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            what = f"cannot be written: {error.strerror or error}"
            raise InputError(what, file=self.path) from error
        about = {
            "suite": plan.suite,
            "suite_hash": plan.suite_hash,
            "options": plan.options,
            "content": {**plan.content},
            "revisions": revisions,
            "machines": machines,
        }
        self._write(ABOUT, about)
        write_table(self.table, rows)
        return rows

    def save(self, rows: Sequence[RunRow], summary: Mapping[str, Any]) -> None:
        """Replace the table and the summary."""
        write_table(self.table, rows)
        self._write(SUMMARY, summary)
        write_text(self.path / MARKDOWN, markdown_table(summary))

    def tidy(self) -> None:
        """Remove the folder of pictures if it is empty."""
        if self.pictures.is_dir() and not any(self.pictures.iterdir()):
            self.pictures.rmdir()

    @property
    def revisions(self) -> list[str]:
        """The revisions of the code that produced the table."""
        return list(self.about().get("revisions", []))

    def about(self) -> dict[str, Any]:
        """The content of ``suite.json``: suite, its hash, options, content, revisions, machines.

        Raises:
            ConfigError: there is no such file, or it is damaged.

        """
        file = self.path / ABOUT
        try:
            about = read_json_object(file)
        except ConfigError as error:
            what = f"{error}; without it the table beside it cannot be continued"
            raise ConfigError(what) from None
        if not isinstance(about.get("content"), dict):
            raise ConfigError("is not a file written by navfw suite", file=file)
        return about

    def _compare(self, known: Mapping[str, str], wanted: Mapping[str, str]) -> None:
        differing = [name for name in {**wanted, **known} if known.get(name) != wanted.get(name)]
        if differing:
            what = f"belongs to another suite or configuration: {differing[0]} differs"
            more = f" (and {len(differing) - 1} more)" if len(differing) > 1 else ""
            raise InputError(f"{what}{more}; choose another --out", file=self.path)

    def _refuse_foreign(self) -> None:
        if is_file(self.table):
            what = "contains a table already: continue it with --resume, or choose another --out"
            raise InputError(what, file=self.path)
        if is_folder(self.path) and {file.name for file in self.path.iterdir()} - {
            self.lock.file.name
        }:
            raise InputError("is not empty; choose another --out", file=self.path)

    def _write(self, name: str, value: Mapping[str, Any]) -> None:
        text = json.dumps(plain_json(value), indent=2, allow_nan=False)
        write_text(self.path / name, text + "\n")


def _created(given: Path | None, default: Path) -> Path:
    """The folder ``given``, created if it is not there, or the first free one by ``default``."""
    if given is not None:
        place = output_place(given, "--out", replaced=False)
        if place.exists() and not place.is_dir():
            raise InputError("is a file; a suite needs a folder", file=given)
        place.mkdir(parents=True, exist_ok=True)
        return given
    for number in itertools.count(1):
        place = default if number == 1 else default.with_name(f"{default.name}-{number}")
        with contextlib.suppress(FileExistsError):
            place.mkdir(parents=True)
            return place
    raise AssertionError("numbers have no end")
