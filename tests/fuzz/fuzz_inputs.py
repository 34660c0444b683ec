"""Try commands on mutated inputs and print the figures.

``uv run python tests/fuzz/fuzz_inputs.py --cases 20000``; ``--only NUMBER`` repeats one case and
leaves its input in ``--keep FOLDER``.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from fuzz_cases import Workshop, fuzz, table


def main() -> int:
    """The command; ends with 1 if there is a defect."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path, default=Path("fuzzed"))
    given = parser.parse_args()
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
