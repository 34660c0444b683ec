"""The table: it is read as written, and invalid files are refused."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from suite_samples import row

from navfw.errors import ConfigError, InputError
from navfw.suite import COLUMNS, RunRow, read_table, summarize, write_table

numbers = st.none() | st.floats(allow_nan=False)
texts = st.text(st.characters(codec="utf-8"), max_size=40)


@given(number=numbers, reason=texts, collisions=st.none() | st.integers(0, 99), world=texts)
def test_rows_are_read_as_written(
    tmp_path_factory: pytest.TempPathFactory,
    number: float | None,
    reason: str,
    collisions: int | None,
    world: str,
) -> None:
    file = tmp_path_factory.mktemp("table") / "table.csv"
    world, reason = " ".join(world.split()), " ".join(reason.split())  # written as one line
    rows = [row(1, world=world, spl=number, reason=reason, collisions=collisions), row(2)]
    write_table(file, rows)
    assert read_table(file) == rows


def test_a_reason_of_several_lines_becomes_one_line(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_table(file, [row(reason="first\nsecond\tthird")])
    assert len(file.read_text().splitlines()) == 2
    assert read_table(file)[0].reason == "first second third"


def test_the_table_is_standard_csv(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_table(file, [row(7, min_clearance_m=math.inf, spl=math.nan, reason='a "b", c')])
    with file.open(newline="") as stream:
        (cells,) = csv.DictReader(stream)
    assert tuple(cells) == tuple(name for name in COLUMNS if name != "variant")
    assert (cells["seed"], cells["min_clearance_m"], cells["spl"]) == ("7", "inf", "")
    assert cells["reason"] == 'a "b", c'


def test_a_failed_write_leaves_the_old_table(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_table(file, [row(1)])

    def rows() -> Iterator[RunRow]:
        yield row(2)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_table(file, rows())
    assert read_table(file) == [row(1)]
    assert list(tmp_path.iterdir()) == [file]


def test_a_table_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_table(tmp_path / "missing" / "table.csv", [])


def lines(*rows: RunRow, folder: Path) -> list[str]:
    write_table(folder / "good.csv", rows)
    return (folder / "good.csv").read_text().splitlines()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda ls: [ls[0].replace("spl,", ""), *ls[1:]], "no column 'spl'"),
        (lambda ls: [ls[0], ls[1].replace(",20.0,", ",soon,")], "2: sim_time_s: expected a number"),
        (lambda ls: [ls[0], ls[1].replace(",reached,", ",won,")], "2: outcome: expected one of"),
        (lambda ls: [ls[0], ls[1][:20]], "2: the line has too few cells"),
        (lambda ls: [ls[0], ls[1], ls[1]], "twice"),
        (lambda ls: [], "no column 'entry'"),
    ],
)
def test_an_invalid_table_is_refused_with_its_line(
    change: Callable[[list[str]], list[str]], message: str, tmp_path: Path
) -> None:
    good = lines(row(1), folder=tmp_path)
    file = tmp_path / "bad.csv"
    file.write_text("\n".join(change(good)) + "\n")
    with pytest.raises(ConfigError, match=message):
        read_table(file)


def test_a_table_without_the_column_of_plugin_faults_is_read(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_table(file, [row(1, plugin_faults=4)])
    assert read_table(file)[0].plugin_faults == 4
    assert summarize([*read_table(file), row(2, plugin_faults=3)])["plugin_faults"] == 7
    with file.open(newline="") as stream:
        head, cells = csv.reader(stream)
    at = head.index("plugin_faults")
    file.write_text("\n".join(",".join(line[:at] + line[at + 1 :]) for line in (head, cells)))
    assert read_table(file)[0].plugin_faults is None


def test_a_missing_or_binary_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read_table(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00entry")
    with pytest.raises(ConfigError, match="expected UTF-8"):
        read_table(tmp_path / "binary.csv")
