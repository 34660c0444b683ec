"""Suite folders with fake rows, and stored results, for the tests of the results' room."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from navfw_benchmarks.results.result_file import Figures, Machine, StoredSuiteResult, StoredValues
from suite_samples import case, row

from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_summary import summarize
from navfw.suite.suitefile import Expect

REVISION = "0123456789abcdef0123456789abcdef01234567"
MACHINE = Machine(processor="Kettle 3000", cores=2, python="3.11.7", system="Linux x86_64")
ORIGIN: dict[str, Any] = {"revision": REVISION, "machine": MACHINE}


def suite_folder(
    path: Path,
    rows: Sequence[RunRow],
    *,
    revision: str = REVISION,
    expect: Mapping[str, Expect] | None = None,
    complete: bool = True,
    options: tuple[str, ...] = (),
) -> SuiteFolder:
    """A folder as ``navfw suite`` leaves it."""
    plan = SuitePlan("rooms", (case(0),), {}, suite_hash="5eed" * 16, options=options)
    folder = SuiteFolder(path)
    folder.open(plan, revision)
    folder.journal.add(plan.cases[0].content, *rows)
    folder.save(rows, {"complete": complete, **summarize(rows, expect)})
    return folder


def suite_result(name: str = "rooms-0-4", **changes: Any) -> StoredSuiteResult:
    """Four runs of ``rooms``, three of which arrived."""
    figures = Figures(
        runs=4,
        reached=3,
        success_low=0.3,
        success_high=0.95,
        collisions=1,
        collisions_by_robot=1,
        spl=0.7,
        sct=0.5,
        barn_score=0.15,
        mean_time_s=20.0,
        min_clearance_m=0.1,
        estimate_error_m=0.05,
        estimate_error_max_m=0.2,
        causes={"collided: slow": 1},
    )
    given = ORIGIN | {"command": "navfw suite rooms --seeds 0:4", "seeds": "0:4"}
    suite = {"stacks": ("default",), "suite": "rooms", "suite_hash": "5eed", "parts": {}}
    return StoredSuiteResult(**{"name": name, "figures": figures, **given, **suite, **changes})


def bench_result(name: str = "bench-loop", **changes: Any) -> StoredValues:
    """What ``navfw bench loop`` gave."""
    given = ORIGIN | {"command": "navfw bench loop --seed 0", "seeds": "0", "kind": "bench"}
    values = {"loop_over_render": 1.234, "spread": {"loop_over_render": [1.1, 1.3]}}
    return StoredValues(**{"name": name, "values": values, **given, **changes})


def mixed_rows() -> list[RunRow]:
    """Seeds 0 to 3: one collides."""
    return [row(seed, "collided" if seed == 2 else "reached") for seed in range(4)]
