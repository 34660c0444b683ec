"""The rows of a suite: the journal gives them as written, the exported table is standard CSV."""

from __future__ import annotations

import csv
import json
import math
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from suite_samples import row

from navfw.errors import InputError
from navfw.suite import COLUMNS, JournalDamagedError, RunJournal, RunRow, write_table
from navfw.suite.run_journal import _checksum

numbers = st.none() | st.floats(allow_nan=False)
texts = st.text(st.characters(codec="utf-8"), max_size=40)


def table_of(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def journal(tmp_path: Path) -> RunJournal:
    made = RunJournal(tmp_path / "journal.sqlite")
    made.create()
    return made


@given(number=numbers, reason=texts, collisions=st.none() | st.integers(0, 99), world=texts)
def test_rows_are_read_as_written(
    tmp_path_factory: pytest.TempPathFactory,
    number: float | None,
    reason: str,
    collisions: int | None,
    world: str,
) -> None:
    journal = RunJournal(tmp_path_factory.mktemp("rows") / "journal.sqlite")
    journal.create()
    world, reason = " ".join(world.split()), " ".join(reason.split())  # written as one line
    rows = [row(1, world=world, spl=number, reason=reason, collisions=collisions), row(2)]
    journal.add_all(("aa", one) for one in rows)
    assert journal.rows(["aa"]) == rows


def test_a_reason_of_several_lines_becomes_one_line(journal: RunJournal, tmp_path: Path) -> None:
    wordy = row(reason="first\nsecond\tthird")
    write_table(tmp_path / "table.csv", [wordy])
    assert len((tmp_path / "table.csv").read_text().splitlines()) == 2
    journal.add("aa", wordy)
    assert journal.rows(["aa"])[0].reason == "first second third"


def test_the_table_is_standard_csv(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_table(file, [row(7, min_clearance_m=math.inf, spl=math.nan, reason='a "b", c')])
    (cells,) = table_of(file)
    assert tuple(cells) == tuple(name for name in COLUMNS if name != "variant")
    assert (cells["seed"], cells["min_clearance_m"], cells["spl"]) == ("7", "inf", "")
    assert cells["reason"] == 'a "b", c'
    write_table(file, [row(1, variant="default"), row(1, variant="paper")])
    assert [cells["variant"] for cells in table_of(file)] == ["default", "paper"]


def test_a_failed_write_leaves_the_old_table(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_table(file, [row(1)])

    def rows() -> Iterator[RunRow]:
        yield row(2)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_table(file, rows())
    assert [cells["seed"] for cells in table_of(file)] == ["1"]
    assert list(tmp_path.iterdir()) == [file]


def test_a_table_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_table(tmp_path / "missing" / "table.csv", [])


@pytest.mark.parametrize(
    "change", [{"spl": "soon"}, {"outcome": "won"}, {"seed": ""}, {"collisions": "1.5"}, None]
)
def test_wrong_cells_are_damage_whatever_their_checksum(
    journal: RunJournal, change: Mapping[str, str] | None
) -> None:
    journal.add("aa", row(1))
    with closing(sqlite3.connect(journal.file)) as database, database:
        ((key, cells),) = database.execute("SELECT key, cells FROM run")
        cells = json.dumps(None if change is None else {**json.loads(cells), **change})
        values = (cells, _checksum("aa", key, cells))
        database.execute("UPDATE run SET cells = ?, checksum = ?", values)
    with pytest.raises(JournalDamagedError, match="is damaged: a row has no valid cells"):
        journal.rows(["aa"])
    assert journal.intact() == []


def test_a_row_of_fewer_columns_is_read(journal: RunJournal) -> None:
    journal.add("aa", row(1, plugin_faults=4))
    assert journal.rows(["aa"])[0].plugin_faults == 4
    with closing(sqlite3.connect(journal.file)) as database, database:
        ((key, text),) = database.execute("SELECT key, cells FROM run")
        cells = json.loads(text)
        del cells["plugin_faults"]
        text = json.dumps(cells)
        values = (text, _checksum("aa", key, text))
        database.execute("UPDATE run SET cells = ?, checksum = ?", values)
    assert journal.rows(["aa"])[0].plugin_faults is None
