"""Try commands on mutated inputs and print the figures.

``uv run python tests/fuzz/fuzz_inputs.py --cases 20000``; ``--only NUMBER`` repeats one case and
leaves its input in ``--keep FOLDER``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from fuzz_cases import MAX_MEMORY, MAX_TIME, Tried, Workshop, work

__all__ = ["fuzz", "main", "table"]


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
            span = [str(numbers.start), str(numbers.stop), str(numbers.step)]
            words = [__file__, "--work", *span, "--seed", str(seed), "--keep", folder]
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


def main() -> int:
    """The command; ends with 1 if there is a defect."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path, default=Path("fuzzed"))
    parser.add_argument("--work", type=int, nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work is not None:
        work(given.keep / "inputs", given.seed, range(*given.work), given.keep / "report.jsonl")
        return 0
    if given.only is not None:
        print(Workshop(given.keep.absolute(), given.seed).attempt(given.only))
        return 0
    done = fuzz(given.cases, given.seed, given.workers)
    print(table(done))
    causes = Counter(f"{tried.kind}: {tried.defect}" for tried in done if tried.defect)
    for cause, count in causes.most_common():
        example = next(t.number for t in done if f"{t.kind}: {t.defect}" == cause)
        print(f"{count:5d} x {cause} (case {example})")
    return 1 if causes else 0


if __name__ == "__main__":
    raise SystemExit(main())
