"""Suite files of a test, their plans, and how to drive these."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import suite_samples as samples

from navfw.plugins import default_registry
from navfw.suite import load_suite
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan, plan_runs
from navfw.suite.suite_run import SuiteResult, run_suite
from navfw.suite.worker_pool import WorkerPool


def suite_file(folder: Path, text: str) -> Path:
    """``mine.yaml`` in ``folder`` with this text."""
    file = folder / "mine.yaml"
    file.write_text(text)
    return file


def planned(folder: Path, text: str, seeds: range = range(1), **options: Any) -> SuitePlan:
    """The runs of a suite with this text."""
    return plan_runs(load_suite(suite_file(folder, text)), seeds, default_registry(), **options)


def drive(
    plan: SuitePlan,
    out: SuiteFolder,
    *,
    work: Callable[[Case], RunRow] = samples.fake_run,
    workers: int = 1,
    memory: float = math.inf,
    **options: Any,
) -> SuiteResult:
    """The suite, driven by processes of this machine; ``work`` drives a run."""
    with WorkerPool(work, workers, 900.0, memory=memory) as engine:
        return run_suite(plan, out, engine, **options)
