"""A scheduler of Dask on loopback with two workers."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest


def _start(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    with (folder / f"{Path(words[-1]).stem}.log").open("wb") as log:
        return subprocess.Popen(  # noqa: S603 - this Python, words of our own
            [sys.executable, "-m", "dask", *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
            stdout=log,
            stderr=subprocess.STDOUT,
        )


Cluster = tuple[str, list[subprocess.Popen[bytes]]]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """The address of a scheduler, and its two workers."""
    pytest.importorskip("distributed", reason="needs the extra dask: uv sync --extra dask")
    file = str(tmp_path / "scheduler.json")
    quiet = ["--no-dashboard", "--host", "127.0.0.1"]
    all_ = [_start(tmp_path, "scheduler", *quiet, "--port", "0", "--scheduler-file", file)]
    for name in ("one", "two"):
        words = ["--no-dashboard", "--no-nanny", "--nthreads", "1", "--name", name]
        all_.append(_start(tmp_path, "worker", "--scheduler-file", file, *words))
    deadline = time.monotonic() + 120.0
    while not Path(file).exists():
        assert time.monotonic() < deadline
        time.sleep(0.1)
    yield json.loads(Path(file).read_text())["address"], all_[1:]
    for process in all_:
        process.kill()
        process.wait()
