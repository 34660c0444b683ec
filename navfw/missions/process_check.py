"""After a run: what plugins changed in the process becomes faults of the result."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from navfw.config.lookup import shipped_folder
from navfw.interfaces import Plugin
from navfw.missions.outcome import FaultKind, Outcome
from navfw.missions.process_state import ProcessState
from navfw.missions.runner import RunResult


def check_process(
    run: RunResult, before: ProcessState, plugins: Iterable[type[Plugin]]
) -> RunResult:
    """``run`` with the changes since ``before`` as faults; the process is set back.

    The changes are told of those ``plugins`` that do not ship with navfw. A run during which
    functions of navfw were replaced is a fault, whatever its outcome seems to be.
    """
    suspects = [f"{cls.kind} {cls.name}" for cls in plugins if not _ships(cls)]
    who = " or ".join(suspects) or "a plugin"
    faults = [f"{who}: {what}" for what in before.changes()]
    verdict = run.verdict
    replaced = before.changed_code()
    if replaced:
        faults.append(f"{who}: replaced {replaced}")
        verdict = replace(
            verdict, outcome=Outcome.FAULT, reason=faults[-1], fault=FaultKind.CODE_REPLACED
        )
    before.restore()
    return replace(run, verdict=verdict, faults=(*run.faults, *faults))


def _ships(cls: type[Plugin]) -> bool:
    """Whether a plugin is navfw's own."""
    if cls.__module__.startswith("navfw."):
        return True
    try:
        file = Path(inspect.getfile(cls)).resolve()
    except (TypeError, OSError):
        return False
    return file.is_relative_to((shipped_folder() / "behaviors").resolve())
