"""What a worker holds: the largest memory so far, and what was freed given back between runs."""

from __future__ import annotations

import subprocess
import sys

import pytest

from navfw.process import peak_memory_mb

FRAGMENTS = """
from pathlib import Path
from navfw.process.process_memory import return_freed_memory

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
    done = subprocess.run(  # noqa: S603 - our own text
        [sys.executable, "-c", FRAGMENTS], capture_output=True, text=True, check=True
    )
    before, after = map(float, done.stdout.split())
    assert after < before - 50.0, "a piece at the end of the heap keeps 100 MB before it"
