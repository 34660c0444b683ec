"""A suite whose parent or worker is killed at seeded moments is resumed and ends complete.

``NAVFW_KILLS=20 uv run pytest -m slow tests/suite/test_suite_killed.py`` takes 20 moments.
"""

import contextlib
import csv
import json
import os
import shutil
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import suite_samples
from cli_calls import PROGRAM
from dask_cluster import Cluster, cluster
from killing import MANY, TINY, Ended, Started, moments

from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder

__all__ = ["cluster"]

FAKE = f"""
sys.path.insert(0, {str(Path(suite_samples.__file__).parent)!r})
from pathlib import Path
from suite_samples import case, slow_fake_run
from navfw.process.interruption import deferred
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_run import run_suite
from navfw.suite.worker_pool import WorkerPool
cases = tuple(case(seed) for seed in range(int(sys.argv[1])))
plan = SuitePlan("rooms", cases, {{"entry rooms": "1234"}})
with deferred(), SuiteFolder.claim(Path("o"), plan, range(40)) as folder:
    have = folder.open(plan, "abc", begin="resume")
    with WorkerPool(slow_fake_run, 2, 900.0) as engine:
        done = run_suite(plan, folder, engine, have=have)
    sys.exit(done.exit_code)
"""

WORDS = ("suite", "tiny.yaml", "--seeds=0:4", "--out=o", "--resume", "--json", "--keep=all")

SIGNALS = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT]


@dataclass(frozen=True)
class Undisturbed:
    """Code and words of a suite, its wall time [s], and its hashes by seed."""

    code: str
    words: tuple[str, ...]
    longest: float
    hashes: dict[int, str]

    def start(self, folder: Path) -> Started:
        """Start the suite, or resume it."""
        (folder / "tiny.yaml").write_text(TINY)
        return Started(self.code, self.words, folder)


def undisturbed(code: str, words: tuple[str, ...], folder: Path) -> Undisturbed:
    first = Undisturbed(code, words, 0.0, {})
    began = time.monotonic()
    ended = first.start(folder).ended()
    assert ended.code == 0, ended.stderr
    hashes = {row.seed: row.command_hash for row in rows_of(folder)}
    return Undisturbed(code, words, time.monotonic() - began, hashes)


@pytest.fixture(scope="module")
def fake(tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    return undisturbed(FAKE, ("8",), tmp_path_factory.mktemp("fake"))


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    return undisturbed(PROGRAM, (*WORDS, "--workers", "2"), tmp_path_factory.mktemp("real"))


def rows_of(folder: Path) -> list[RunRow]:
    """The rows of the journal, valid at any time; none before it is there."""
    out = SuiteFolder(folder / "o")
    return out.rows() if out.journal.file.exists() else []


def check_files(folder: Path) -> None:
    """Nothing hidden is left, and all files are whole."""
    hidden = [file for file in folder.rglob(".*") if file.name != ".nv"]
    assert not hidden
    for file in (folder / "o").glob("*.json"):
        json.loads(file.read_text())


def check_stopped(ended: Ended, folder: Path, suite: Undisturbed, number: signal.Signals) -> None:
    """The table is valid and the exit code tells whether every run has a result."""
    rows = rows_of(folder)
    complete = {row.seed for row in rows if row.has_result} == set(suite.hashes)
    if complete:  # a signal may come when the suite has ended, and Python has not
        assert ended.code in {0, -number}, ended.stderr
        return
    assert ended.code != 0
    assert all(row.has_result or row.died for row in rows)
    assert "resource_tracker" not in ended.stderr
    assert "Traceback" not in ended.stderr or not (folder / "o").exists()  # while importing
    check_files(folder)


def check_resumed(folder: Path, suite: Undisturbed) -> None:
    """Resumed, the suite ends complete with every case once, and the same commands."""
    kept = {row.seed: row for row in rows_of(folder) if row.has_result}
    ended = suite.start(folder).ended()
    assert ended.code == 0, ended.stderr
    rows = sorted(rows_of(folder), key=lambda row: row.seed)
    wanted = sorted(suite.hashes.items())
    assert [(row.seed, row.command_hash) for row in rows] == wanted
    with (folder / "o" / "table.csv").open(newline="") as stream:
        table = [(int(row["seed"]), row["command_hash"]) for row in csv.DictReader(stream)]
    assert table == wanted
    assert all(row == kept.get(row.seed, row) for row in rows), "a finished run was driven again"
    check_files(folder)


def kill(who: str, suite: Undisturbed, number: signal.Signals, count: int, folder: Path) -> None:
    """Kill the ``parent`` or a ``worker`` of the suite at ``count`` moments, and resume it."""
    for index, moment in enumerate(moments(number, count, suite.longest)):
        here = folder / f"{who}-{index}"
        here.mkdir()
        started = suite.start(here)
        if who == "parent":
            if started.after(moment):
                started.send(number)
        else:
            while started.running() and not started.workers():
                time.sleep(0.01)
            if started.after(0.7 * moment) and (workers := started.workers()):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(workers[index % len(workers)], number)
        ended = started.ended()  # with all workers
        if who == "worker" or number is not signal.SIGKILL:
            check_stopped(ended, here, suite, number)
        check_resumed(here, suite)
        shutil.rmtree(here)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("who", "number"),
    [
        ("parent", signal.SIGKILL),
        pytest.param("parent", signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param("worker", signal.SIGKILL, marks=pytest.mark.slow),
    ],
)
def test_a_killed_process(
    who: str, number: signal.Signals, fake: Undisturbed, tmp_path: Path
) -> None:
    kill(who, fake, number, 1, tmp_path)


def test_ctrl_c_while_workers_start_prints_no_traceback(tmp_path: Path) -> None:
    started = Started(FAKE, ("8",), tmp_path)
    while started.running() and not started.workers():
        time.sleep(0.005)
    started.send(signal.SIGINT)
    ended = started.ended()
    assert (ended.code, ended.stderr) == (130, "")


@pytest.mark.slow
def test_forty_runs_killed_twenty_times(tmp_path: Path) -> None:
    """The parent and a worker in turn."""
    suite = undisturbed(FAKE, ("40",), tmp_path)
    shutil.rmtree(tmp_path / "o")
    kept: dict[int, RunRow] = {}
    for index, moment in enumerate(moments(40, 20, 3.0)):
        started = suite.start(tmp_path)
        if started.after(1.0 + moment):
            workers = started.workers() if index % 2 else []
            with contextlib.suppress(ProcessLookupError):
                os.kill(workers[0] if workers else started.pid, signal.SIGKILL)
        if index % 2:
            started.send(signal.SIGKILL)
        started.ended()
        rows = rows_of(tmp_path)
        finished = {row.seed: row for row in rows if row.has_result}
        assert len({row.seed for row in rows}) == len(rows), "a run is there twice"
        assert kept.items() <= finished.items(), "a finished run was lost, or driven again"
        kept = finished
    check_resumed(tmp_path, suite)


@pytest.mark.slow
@pytest.mark.parametrize("who", ["parent", "worker"])
@pytest.mark.parametrize("number", SIGNALS)
def test_a_process_killed_at_many_moments(
    who: str, number: signal.Signals, real: Undisturbed, tmp_path: Path
) -> None:
    kill(who, real, number, MANY, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS)
def test_a_suite_on_a_cluster_killed_at_many_moments(
    number: signal.Signals, cluster: Cluster, tmp_path: Path
) -> None:
    words = (*WORDS, "--engine", "dask", "--scheduler", cluster[0])
    kill("parent", undisturbed(PROGRAM, words, tmp_path), number, MANY, tmp_path)
