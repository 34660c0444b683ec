"""Many fuzz cases in worker processes, and the figures of what became of them."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fuzz_cases
from fuzz_cases import MAX_MEMORY, MAX_TIME, Tried

__all__ = ["fuzz", "table"]


def fuzz(cases: int, seed: int = 0, workers: int = 2) -> list[Tried]:
    """The outcomes of the cases 0 to ``cases`` - 1, tried in ``workers`` processes."""
    shares = [range(first, cases, workers) for first in range(workers)]
    with ThreadPoolExecutor(workers) as pool:
        done = list(pool.map(lambda share: _share(share, seed), shares))
    return sorted((tried for part in done for tried in part), key=lambda tried: tried.number)


def _share(numbers: range, seed: int) -> list[Tried]:
    """The outcomes of these cases; a process that dies costs its case, and a new one goes on."""
    done: list[Tried] = []
    while numbers:
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.jsonl"
            span = map(str, (seed, numbers.start, numbers.stop, numbers.step))
            words = [str(fuzz_cases.__file__), folder, *span]
            ended = subprocess.run(  # noqa: S603
                [sys.executable, *words], capture_output=True, check=False
            )
            stderr = ended.stderr.decode(errors="replace")
            lines = report.read_text().splitlines() if report.exists() else []
        entries = [json.loads(line) for line in lines]
        done += [Tried(**entry) for entry in entries if "kind" in entry]
        began = [entry["began"] for entry in entries if "began" in entry]
        if not began:
            raise RuntimeError(f"the worker did not start:\n{stderr}")
        if ended.returncode:
            what = f"the process ended with {ended.returncode}: {stderr[-2000:]}"
            done.append(Tried(began[-1], "?", -1, 0.0, 0.0, what))
        numbers = range(began[-1] + numbers.step, numbers.stop, numbers.step)
    return done


def table(done: Sequence[Tried]) -> str:
    """The figures, a line for each kind of input."""
    lines = [
        "| input | cases | read | refused | longest [s] | defects |",
        "|---|---|---|---|---|---|",
    ]
    for kind in [*sorted({tried.kind for tried in done}), "all"]:
        of_kind = [tried for tried in done if kind in (tried.kind, "all")]
        codes = Counter(tried.code for tried in of_kind)
        refused, defects = codes[2], sum(bool(tried.defect) for tried in of_kind)
        longest = max(tried.seconds for tried in of_kind)
        read = len(of_kind) - refused - codes[-1]
        lines.append(
            f"| {kind} | {len(of_kind)} | {read} | {refused} | {longest:.1f} | {defects} |"
        )
    peak = max(tried.megabytes for tried in done)
    lines.append(f"\nlargest memory of a process: {peak:.0f} MB (at most {MAX_MEMORY:.0f} allowed,")
    lines.append(f"and {MAX_TIME:.0f} s of computing for each case)")
    return "\n".join(lines)
