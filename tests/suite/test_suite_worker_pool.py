"""Worker processes: parallel, single-threaded, replaceable; the memory that they hold."""

import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import suite_samples as samples
from processes import printed

from navfw.errors import SimulationError
from navfw.missions.outcome import Cause
from navfw.process.process_resources import peak_memory_mb
from navfw.suite.worker_pool import WorkerFailure, WorkerPool


def test_jobs_run_in_parallel_in_separate_processes(tmp_path: Path) -> None:
    with WorkerPool(samples.meet, workers=2, limit=120.0) as pool:
        assert [met for _, met in pool.run([str(tmp_path)] * 2)] == [True, True]
    assert str(os.getpid()) not in {file.name for file in tmp_path.iterdir()}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("work", "message", "limit"),
    [
        (samples.crash_on_13, "ended without a result", 60.0),
        (samples.hang_in_plugin_on_13, "in hang_in_plugin_on_13: exceeded the wall-clock", 2.0),
        (samples.raise_on_13, "ValueError: thirteen is refused", 60.0),
        (samples.sleep_on_13, "the wall-clock limit of 2 s", 2.0),
    ],
)
def test_a_failing_job_is_reported_and_the_others_complete(
    work: Callable[[int], int], message: str, limit: float
) -> None:
    with WorkerPool(work, workers=2, limit=limit) as pool:
        results = dict(pool.run([1, 13, 2, 3]))
    bad = results.pop(13)
    assert isinstance(bad, WorkerFailure)
    assert message in bad.reason
    assert (bad.cause is Cause.TOO_LONG) == (limit == 2.0)
    assert results == {1: 1, 2: 2, 3: 3}


@pytest.mark.thorough
def test_threads_that_a_job_leaves_behind_do_not_keep_its_process() -> None:
    began = time.monotonic()
    with WorkerPool(samples.leave_a_thread, workers=1, limit=60.0, recycle=1) as pool:
        assert dict(pool.run([2, 3])) == {2: 4, 3: 9}
    assert time.monotonic() - began < 60.0


def test_processes_are_replaced_after_some_jobs() -> None:
    with WorkerPool(samples.napping, workers=1, limit=60.0, recycle=2) as pool:
        pids = [pid for _, pid in pool.run([0.0] * 4)]
    assert pids[0] == pids[1] != pids[2] == pids[3]


def test_a_process_that_is_killed_between_two_jobs_is_replaced() -> None:
    with WorkerPool(samples.napping, workers=1, limit=60.0) as pool:
        results = pool.run([0.0, 0.0])
        pid = next(results)[1]
        assert isinstance(pid, int)
        os.kill(pid, signal.SIGKILL)
        time.sleep(1.0)
        other = next(results)[1]
        assert isinstance(other, int)
        assert other != pid
        assert list(results) == []


def test_workers_use_one_thread_and_the_parent_s_environment_is_unchanged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"]
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with WorkerPool(samples.environment, workers=1, limit=60.0) as pool:
        assert dict(pool.run(names)) == dict.fromkeys(names, "1")
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_a_pool_whose_processes_all_die_raises() -> None:
    with (
        WorkerPool(samples.die, workers=1, limit=60.0) as pool,
        pytest.raises(SimulationError, match="all worker processes die"),
    ):
        list(pool.run(range(100)))


def test_leaving_the_pool_skips_the_remaining_jobs() -> None:
    began = time.monotonic()
    with WorkerPool(samples.napping, workers=1, limit=60.0) as pool:
        for _ in pool.run([0.1] * 6000):
            break
    assert time.monotonic() - began < 300.0


FRAGMENTS = """
from pathlib import Path
from navfw.process.process_resources import return_freed_memory

def resident():
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS:")).split()[1]) / 1024

pieces = [bytes(4000) for _ in range(25_000)]
kept = pieces[-1]
del pieces
before = resident()
return_freed_memory()
print(before, resident())
"""


def test_the_peak_is_no_less_than_what_was_held() -> None:
    held = bytearray(50_000_000)
    assert peak_memory_mb() > 50.0
    assert len(held) == 50_000_000


@pytest.mark.skipif(sys.platform != "linux", reason="glibc has malloc_trim")
def test_freed_memory_is_given_back() -> None:
    before, after = map(float, printed(FRAGMENTS).split())
    assert after < before - 50.0, "a piece at the end of the heap keeps 100 MB before it"
