"""A suite from plan to table with fake runs: completeness, resuming, interruptions, refusals."""

import csv
import json
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import suite_samples as samples
from cli_calls import put_files
from suite_plans import drive

from navfw.errors import InputError
from navfw.missions.outcome import Cause
from navfw.recording import machine_kind
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import StartMode, SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_run import SuiteResult

CONTENT = {"entry rooms": "1234", "stack default of entry rooms": "5678"}


def plan(*seeds: int) -> SuitePlan:
    cases = tuple(samples.case(seed, index) for index, seed in enumerate(seeds))
    return SuitePlan("rooms", cases, CONTENT)


def run(
    wanted: SuitePlan, out: SuiteFolder, *, begin: StartMode = "new", **options: Any
) -> SuiteResult:
    have = out.open(wanted, "abc", begin=begin)
    return drive(wanted, out, have=have, **options)


@pytest.fixture
def out(tmp_path: Path) -> SuiteFolder:
    return SuiteFolder(tmp_path / "out")


def test_the_table_is_complete_and_in_order(out: SuiteFolder) -> None:
    seeds: list[int] = []
    done = run(plan(5, 4, 3, 2), out, workers=2, on_row=lambda case, row: seeds.append(row.seed))
    assert done.complete
    assert sorted(seeds) == [2, 3, 4, 5]
    assert {row.seed: row for row in out.rows()} == {row.seed: row for row in done.rows}
    with out.table.open(newline="") as stream:
        table = [(int(row["seed"]), row["outcome"]) for row in csv.DictReader(stream)]
    assert table == [(5, "timeout"), (4, "reached"), (3, "timeout"), (2, "reached")]
    assert [(row.seed, row.outcome) for row in done.rows] == table
    summary = json.loads((out.path / "summary.json").read_text())
    assert (summary["complete"], summary["success"]) == (True, 0.5)
    assert summary["causes"] == {"timeout: slow": 2}
    files = sorted(p.name for p in out.path.iterdir())
    assert files == ["journal.sqlite", "suite.json", "summary.json", "table.csv", "table.md"]


def test_ctrl_c_keeps_finished_runs_and_resume_makes_the_others(out: SuiteFolder) -> None:
    def press(case: Case, row: RunRow) -> None:
        if row.seed == 3:
            raise KeyboardInterrupt

    wanted = plan(2, 3, 4, 5)
    first = run(wanted, out, on_row=press)
    assert not first.complete
    assert first.summary["complete"] is False
    assert [row.seed for row in out.rows()] == [2, 3]

    marked = run(wanted, out, begin="resume", work=samples.fake_run_by_hand)
    assert marked.complete
    assert [row.seed for row in marked.rows] == [2, 3, 4, 5]
    made = sorted(file.stem for file in out.pictures.iterdir())
    assert made == ["4", "5"]  # finished runs are not repeated
    assert run(wanted, out, begin="resume", work=samples.die).complete  # nothing is left to do


def test_a_table_can_be_extended_by_seeds(out: SuiteFolder) -> None:
    run(plan(2, 3), out)
    grown = run(plan(3, 4), out, begin="resume")
    assert grown.complete
    assert [row.seed for row in grown.rows] == [3, 4, 2]


def test_a_run_that_dies_once_is_driven_again_at_the_end(out: SuiteFolder) -> None:
    seen: list[int] = []
    work = samples.fake_run_that_dies_once_on_3
    done = run(plan(3, 4, 5), out, work=work, on_row=lambda case, row: seen.append(row.seed))
    assert (done.complete, done.exit_code) == (True, 0)
    assert seen == [4, 5, 3]
    assert [row.attempts for row in done.rows] == [2, 1, 1]


def test_a_death_before_the_suite_was_killed_counts(out: SuiteFolder) -> None:
    wanted = plan(2, 3)
    out.open(wanted, "abc")
    died = wanted.cases[1].fault("it died", Cause.PROCESS_DIED)
    out.journal.add("", replace(died, attempts=1))
    done = run(wanted, out, begin="resume", work=samples.fake_run_that_dies_on_3_once_more)
    fault = done.rows[1]
    assert (fault.cause, fault.attempts, done.exit_code) == ("process_died", 2, 1)
    assert len(list(out.pictures.iterdir())) == 1  # driven once, as it had died before


def test_a_run_with_too_much_memory_is_a_fault_with_its_reason(out: SuiteFolder) -> None:
    done = run(plan(2, 3), out, work=samples.fake_run_that_swells_on_3, memory=400.0)
    assert [row.cause for row in done.rows] == ["", "too_much_memory"]
    assert "exceeded the limit of 400 MB" in done.rows[1].reason
    assert (done.summary["died"], done.exit_code) == (1, 1)


def test_revisions_are_recorded(out: SuiteFolder) -> None:
    run(plan(2), out)
    out.open(plan(2), "def-dirty", begin="resume")
    assert out.about()["revisions"] == ["abc", "def-dirty"]
    assert out.about()["machines"] == [machine_kind()]


def test_nothing_is_overwritten(out: SuiteFolder, tmp_path: Path) -> None:
    run(plan(2), out)
    with pytest.raises(InputError, match="--resume"):
        out.open(plan(2), "abc")
    put_files(tmp_path, {"mine/notes.txt": "", "file": ""})
    modes: tuple[StartMode, ...] = ("new", "resume")
    for begin in modes:
        with pytest.raises(InputError, match="is not empty"):
            SuiteFolder(tmp_path / "mine").open(plan(2), "abc", begin=begin)
    for where in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError):
            SuiteFolder(where).open(plan(2), "abc")


def test_a_damaged_folder_is_not_continued(out: SuiteFolder) -> None:
    run(plan(2), out)
    (out.path / "suite.json").write_text("{")
    with pytest.raises(InputError, match=r"suite\.json"):
        out.open(plan(2), "abc", begin="resume")


def test_default_folders_are_numbered(workdir: Path) -> None:
    names = []
    for _ in range(2):
        with SuiteFolder.claim(None, plan(2), range(2, 3)) as out:
            out.open(plan(2), "abc")
            names.append(str(out.path))
    assert names == ["runs/rooms-2-3", "runs/rooms-2-3-2"]


def test_died_runs_are_no_success_and_are_driven_again(out: SuiteFolder) -> None:
    died = run(plan(2, 3, 4), out, work=samples.fake_run_that_dies_on_3)
    assert (died.complete, died.summary["died"], died.exit_code) == (True, 1, 1)
    fault = died.rows[1]
    assert (fault.seed, fault.outcome, fault.cause) == (3, "fault", "process_died")
    assert "without a result" in fault.reason
    assert [row.outcome for row in died.rows] == ["reached", "fault", "reached"]
    assert died.summary["success"] == pytest.approx(2 / 3)
    again = run(plan(2, 3, 4), out, begin="resume", work=samples.fake_run_by_hand)
    assert (again.complete, again.summary["died"], again.exit_code) == (True, 0, 0)
    assert [row.outcome for row in again.rows] == ["reached", "timeout", "reached"]
    assert [file.stem for file in out.pictures.iterdir()] == ["3"]


def test_a_plugin_that_fails_uninvited_fails_the_suite(out: SuiteFolder) -> None:
    done = run(plan(2, 3), out, work=samples.fake_run_with_plugin_faults)
    assert (done.complete, done.summary["plugin_faults"], done.exit_code) == (True, 4, 1)


def test_a_table_that_cannot_be_written_is_in_the_result(out: SuiteFolder, tmp_path: Path) -> None:
    def lose_the_folder(case: Case, row: RunRow) -> None:
        if row.seed == 3:
            out.path.rename(tmp_path / "away")

    done = run(plan(2, 3), out, on_row=lose_the_folder)
    assert [row.seed for row in done.rows] == [2, 3]
    assert "table.csv: cannot be written" in done.unsaved
    assert done.exit_code == 3


def test_a_folder_that_another_suite_writes_is_refused(workdir: Path) -> None:

    def claimed(name: str) -> AbstractContextManager[SuiteFolder]:
        return SuiteFolder.claim(workdir / name, plan(2), range(2, 3))

    with claimed("out") as out:
        out.open(plan(2), "abc")
        with pytest.raises(InputError, match="another suite is writing it"), claimed("out"):
            pass
    with claimed("out") as out:
        assert out.open(plan(2), "abc", begin="resume") == []
    files = sorted(file.name for file in out.path.iterdir())
    assert files == ["journal.sqlite", "pictures", "suite.json"]
    (workdir / "link").symlink_to(workdir / "none")
    with pytest.raises(InputError, match="is a link to"), claimed("link"):
        pass
