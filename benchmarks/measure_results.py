"""Measure the results in ``results`` anew, each by the command that it holds.

Those of the code's own revision are left out, so that an interrupted measurement goes on. ``DIR``
in a command stands for the folder of recordings, or for ``barn`` in it: BARN's imported worlds::

    uv run python benchmarks/measure_results.py --data DIR [NAME ...]
    uv run navfw results write
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from navfw_benchmarks.results.collection import collect
from navfw_benchmarks.results.result_file import StoredResult, load_results, save_result

from navfw.recording import code_revision

RESULTS = Path(__file__).parent / "results"
_VARIANT = " --variant "
_OPTIONS = {
    "suite": ["--workers", "2", "--quiet", "--out", "out"],
    "run": ["--quiet", "--out", "out"],
    "bench": ["--quiet", "--json"],
}


def measured(command: str, results: Sequence[StoredResult], data: Path) -> Iterator[StoredResult]:
    """What ``command`` gives, in the place of ``results``: those of one suite, run or benchmark."""
    kind = results[0].kind
    alone = None if _VARIANT in results[0].command else results[0].name
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out")
        Path(folder, "DIR").symlink_to(data.resolve() / ("barn" if kind == "suite" else ""))
        words = [sys.executable, "-m", *shlex.split(command), *_OPTIONS[kind]]
        done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, check=False)  # noqa: S603 - no shell
        if kind == "bench":
            out.write_bytes(done.stdout)
        yield from collect(out, alone, total=alone is not None)


def main() -> int:
    """Measure what is asked for; 1 if something is to be measured by hand."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args()
    by_command: dict[str, list[StoredResult]] = {}
    for result in load_results(asked.results):
        by_command.setdefault(result.command.split(_VARIANT)[0], []).append(result)
    by_hand = 0
    for command, results in by_command.items():
        new = all(result.revision == code_revision() for result in results)
        if new or (asked.names and not {result.name for result in results} & {*asked.names}):
            continue
        sys.stdout.write(f"{command}\n")
        sys.stdout.flush()
        if command.startswith("navfw "):
            for result in measured(command, results, asked.data):
                save_result(asked.results, result)
        else:
            by_hand = 1
    return by_hand


if __name__ == "__main__":
    sys.exit(main())
