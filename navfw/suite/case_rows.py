"""Parts of table rows that need no result: the columns of a case, and rows of faults."""

from __future__ import annotations

from typing import Any

from navfw.missions.outcome import Outcome
from navfw.suite.case import Case
from navfw.suite.failure_causes import Cause
from navfw.suite.run_table import RunRow
from navfw.suite.worker_pool import WorkerFailure


def fault_row(case: Case, reason: str, cause: Cause) -> RunRow:
    """The row of a run that ended without a result."""
    return RunRow(
        **case_columns(case),
        outcome=Outcome.FAULT.value,
        reason=" ".join(reason.split()),
        cause=cause.value,
    )


def row_of(case: Case, result: RunRow | WorkerFailure) -> RunRow:
    """What an engine answers for ``case``, as a row."""
    if isinstance(result, WorkerFailure):
        return fault_row(case, result.reason, result.cause)
    return result


def case_columns(case: Case) -> dict[str, Any]:
    """The columns that are known before the run."""
    return {
        "entry": case.entry,
        "family": case.family,
        "world": case.world_name,
        "mission": case.mission_name,
        "seed": case.seed,
        "difficulty": case.difficulty,
        "stack": case.stack_name,
        "variant": case.variant,
    }
