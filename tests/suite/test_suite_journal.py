"""The journal and the table of a suite: rows as written, whole after damage and changes."""

import csv
import json
import math
import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import suite_samples as samples
from hypothesis import given
from hypothesis import strategies as st
from processes import printed
from suite_plans import drive
from suite_samples import row

from navfw.errors import InputError
from navfw.process.atomic import write_text
from navfw.suite import run_row, suite_folder
from navfw.suite.run_row import COLUMNS, OPTIONAL, RunJournal, table_cells
from navfw.suite.suite_folder import StartMode, SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_run import SuiteResult


def plan(seeds: int = 4, **contents: str) -> SuitePlan:
    """Runs of entries by name, each with its content."""
    cases = [
        samples.case(seed, entry=entry, content=content)
        for entry, content in (contents or {"rooms": "aa"}).items()
        for seed in range(seeds)
    ]
    numbered = tuple(replace(case, index=index) for index, case in enumerate(cases))
    return SuitePlan("rooms", numbered, {f"entry {name}": c for name, c in contents.items()})


def run(
    wanted: SuitePlan, out: SuiteFolder, begin: StartMode = "new", told: list[str] | None = None
) -> tuple[SuiteResult, list[tuple[str, int]]]:
    """The result, and entry and seed of the runs that were driven."""
    driven: list[tuple[str, int]] = []
    notes = [] if told is None else told
    have = out.open(wanted, "abc", begin=begin, tell=notes.append)
    ended = lambda case, row: driven.append((case.entry, row.seed))  # noqa: E731
    return drive(wanted, out, have=have, on_row=ended), driven


@pytest.fixture
def out(tmp_path: Path) -> SuiteFolder:
    return SuiteFolder(tmp_path / "out")


@pytest.fixture
def journal(tmp_path: Path) -> RunJournal:
    made = RunJournal(tmp_path / "journal.sqlite")
    made.create()
    return made


def test_the_journal_has_every_run_as_it_ends(out: SuiteFolder) -> None:
    wanted, seeds = plan(), []

    def count(*_: object) -> None:
        seeds.append([row.seed for row in out.rows()])

    drive(wanted, out, have=out.open(wanted, "abc"), on_row=count)
    assert seeds == [[0], [0, 1], [0, 1, 2], [0, 1, 2, 3]]


def test_a_row_replaces_an_earlier_one_of_the_same_run(journal: RunJournal) -> None:
    journal.add("aa", row(1, "fault"))
    journal.add("aa", row(1))
    journal.add("bb", row(1, "stuck"))
    assert journal.rows(["aa"]) == [row(1)]
    assert [row.outcome for row in journal.rows(["bb", "aa"])] == ["stuck", "reached"]


@pytest.mark.parametrize(
    ("module", "last"), [(suite_folder, "write_text"), (run_row, "atomic_file")]
)
def test_a_suite_that_dies_as_it_begins_is_resumed(
    out: SuiteFolder, monkeypatch: pytest.MonkeyPatch, module: ModuleType, last: str
) -> None:
    done = getattr(module, last)

    def die(*arguments: object) -> None:
        done(*arguments)
        raise SystemExit

    with monkeypatch.context() as patched:
        patched.setattr(module, last, die)
        with pytest.raises(SystemExit):
            out.open(plan(), "abc")
    if out.has_runs:
        assert out.rows() == []
    result, driven = run(plan(), out, "resume")
    assert result.complete
    assert len(driven) == 4


KILLED_WHILE_WRITING = """
import os, sqlite3, sys
database = sqlite3.connect(sys.argv[1])
database.execute("PRAGMA cache_size = 1")
database.execute("BEGIN")
for number in range(500):
    database.execute("INSERT INTO run VALUES ('aa', ?, ?)", (str(number), "x" * 2000))
os._exit(0)
"""


def test_what_a_kill_left_unfinished_is_rolled_back(out: SuiteFolder) -> None:
    wanted = plan()
    run(wanted, out)
    before = out.rows()
    printed(KILLED_WHILE_WRITING, out.journal.file)
    assert (out.path / "journal.sqlite-journal").exists()
    assert out.rows() == before
    assert run(wanted, out, "resume")[1] == []


def test_extend_keeps_what_a_change_has_not_touched(out: SuiteFolder) -> None:
    run(plan(2, rooms="aa", maze="bb"), out)
    changed, told = plan(2, rooms="aa", maze="cc", poles="dd"), list[str]()
    with pytest.raises(InputError, match=r"entry maze differs \(and 1 more\); keep .* --extend"):
        out.open(changed, "abc", begin="resume")
    done, driven = run(changed, out, "extend", told)
    assert driven == [("maze", 0), ("maze", 1), ("poles", 0), ("poles", 1)]
    assert len(done.rows) == len(out.rows()) == 6
    assert told == ["the suite was changed: 2 finished runs are unchanged and kept"]
    # the runs of the first version are still there
    assert run(plan(2, rooms="aa", maze="bb"), out, "extend")[1] == []


def test_restart_moves_the_earlier_results_aside(out: SuiteFolder) -> None:
    run(plan(2), out)
    told: list[str] = []
    assert len(run(plan(3), out, "restart", told)[1]) == 3
    assert told == [f"{out.path}: the earlier results are in before-1"]
    assert len(SuiteFolder(out.path / "before-1").rows()) == 2
    assert len(run(plan(3), out, "restart")[1]) == 3
    assert run(plan(3), out, "resume")[1] == []


def damaged_page(journal: bytes) -> bytes:
    middle = len(journal) // 2 // 4096 * 4096
    return journal[:middle] + b"\xff" * 4096 + journal[middle + 4096 :]


@pytest.mark.parametrize(
    "damaged",
    [
        lambda _: b"",
        lambda _: b"no database at all" * 300,
        lambda journal: journal.replace(b"tablerunrun", b"tabler\xe3nrun"),
        damaged_page,
    ],
    ids=["empty", "text", "a name that is no UTF-8", "a page in the middle"],
)
def test_a_damaged_journal_is_refused_and_kept_by_restart(
    out: SuiteFolder, damaged: Callable[[bytes], bytes]
) -> None:
    run(plan(80), out)
    content = damaged(out.journal.file.read_bytes())
    out.journal.file.write_bytes(content)
    for read in (out.rows, lambda: out.open(plan(80), "abc", begin="resume")):
        with pytest.raises(
            InputError, match=r"journal\.sqlite: .*--restart drives the suite again"
        ):
            read()
    assert len(run(plan(5), out, "restart")[1]) == 5
    assert (out.path / "before-1" / "journal.sqlite").read_bytes() == content


def test_a_table_without_its_journal_is_not_read(out: SuiteFolder) -> None:
    run(plan(), out)
    out.journal.file.unlink()
    missing = r"out: has no journal\.sqlite.*drive them again with --restart"
    for read in (out.rows, lambda: out.open(plan(), "abc", begin="resume")):
        with pytest.raises(InputError, match=missing):
            read()
    assert len(run(plan(), out, "restart")[1]) == 4


def test_what_is_no_folder_of_a_suite_has_no_rows(tmp_path: Path) -> None:
    (tmp_path / "table.csv").touch()
    (tmp_path / "empty").mkdir()
    for name, message in (
        ("none", "is no folder; expected that of a suite"),
        ("table.csv", "is no folder; expected that of a suite"),
        ("empty", "has no journal.sqlite, the only file from which runs of a suite are read"),
    ):
        with pytest.raises(InputError, match=f"{name}: {message}"):
            SuiteFolder(tmp_path / name).rows()


def test_a_journal_of_another_version_is_refused(out: SuiteFolder) -> None:
    run(plan(), out)
    with closing(sqlite3.connect(out.journal.file)) as database:
        database.execute("PRAGMA user_version = 9")
    with pytest.raises(InputError, match="written by another version of navfw"):
        out.open(plan(), "abc", begin="resume")


numbers = st.none() | st.floats(allow_nan=False)
texts = st.text(st.characters(codec="utf-8"), max_size=40)
lines = texts.map(lambda text: " ".join(text.split()))


def table_of(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@given(spl=numbers, reason=lines, collisions=st.none() | st.integers(0, 99), world=lines)
def test_rows_are_read_as_written(tmp_path_factory: pytest.TempPathFactory, **values: Any) -> None:
    journal = RunJournal(tmp_path_factory.mktemp("rows") / "journal.sqlite")
    journal.create()
    rows = [row(1, **values), row(2)]
    journal.add("aa", *rows)
    assert journal.rows(["aa"]) == rows


def test_a_reason_of_several_lines_becomes_one_line(journal: RunJournal, tmp_path: Path) -> None:
    wordy = row(reason="first\nsecond\tthird")
    write_text(tmp_path / "table.csv", table_cells([wordy]))
    assert len((tmp_path / "table.csv").read_text().splitlines()) == 2
    journal.add("aa", wordy)
    assert journal.rows(["aa"])[0].reason == "first second third"


def test_the_table_is_standard_csv(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    odd = row(7, min_clearance_m=math.inf, spl=math.nan, reason='a "b", c')
    write_text(file, table_cells([odd]))
    (cells,) = table_of(file)
    assert tuple(cells) == tuple(name for name in COLUMNS if name not in OPTIONAL)
    assert (cells["seed"], cells["min_clearance_m"], cells["spl"]) == ("7", "inf", "")
    assert cells["reason"] == 'a "b", c'
    write_text(file, table_cells([row(1, variant="default"), row(1, variant="paper")]))
    assert [cells["variant"] for cells in table_of(file)] == ["default", "paper"]


def rewrite(journal: RunJournal, change: Callable[[dict[str, Any]], object]) -> None:
    """Change the cells of the only row."""
    with closing(sqlite3.connect(journal.file)) as database, database:
        ((text,),) = database.execute("SELECT cells FROM run")
        database.execute("UPDATE run SET cells = ?", (json.dumps(change(json.loads(text))),))


@pytest.mark.parametrize(
    "change", [{"spl": "soon"}, {"outcome": "won"}, {"seed": ""}, {"collisions": "1.5"}, None]
)
def test_wrong_cells_are_damage(journal: RunJournal, change: Mapping[str, str] | None) -> None:
    journal.add("aa", row(1))
    rewrite(journal, lambda cells: None if change is None else {**cells, **change})
    with pytest.raises(InputError, match="is damaged: a row has no valid cells"):
        journal.rows(["aa"])


def test_a_row_of_fewer_columns_is_read(journal: RunJournal) -> None:
    journal.add("aa", row(1, plugin_faults=4))
    assert journal.rows(["aa"])[0].plugin_faults == 4
    rewrite(journal, lambda cells: {k: v for k, v in cells.items() if k != "plugin_faults"})
    assert journal.rows(["aa"])[0].plugin_faults is None
