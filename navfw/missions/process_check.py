"""Changes that plugins have made in the process of a run, as faults of its result."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import replace

from navfw.config.input_file import real_path
from navfw.config.lookup import shipped_folder
from navfw.interfaces import Plugin
from navfw.missions.outcome import FaultKind, Outcome
from navfw.missions.runner import RunResult
from navfw.process import ProcessState


def own_plugins(plugins: Iterable[type[Plugin]]) -> str:
    """Those of ``plugins`` that do not ship with navfw, as in ``behavior a or fusion b``."""
    return " or ".join(f"{cls.kind} {cls.name}" for cls in plugins if not _ships(cls))


def check_process(
    run: RunResult, before: ProcessState, plugins: Iterable[type[Plugin]], replaced: str
) -> RunResult:
    """``run`` with the changes since ``before`` as faults; the process is set back.

    The faults name those ``plugins`` that do not ship with navfw. A run during which functions were
    ``replaced`` (``CodeState.restore``) is a fault, whatever its outcome seems to be.
    """
    who = own_plugins(plugins) or "a plugin"
    faults = [f"{who}: {what}" for what in before.changes()]
    verdict = run.verdict
    if replaced:
        faults.append(f"{who}: replaced {replaced}")
        verdict = replace(
            verdict, outcome=Outcome.FAULT, reason=faults[-1], fault=FaultKind.CODE_REPLACED
        )
    before.restore()
    return replace(
        run, verdict=verdict, faults=(*run.faults, *faults), process_faults=tuple(faults)
    )


def _ships(cls: type[Plugin]) -> bool:
    """Whether a plugin is navfw's own."""
    if cls.__module__.startswith("navfw."):
        return True
    try:
        file = real_path(inspect.getfile(cls))
    except (TypeError, OSError):
        return False
    return file.is_relative_to(shipped_folder() / "behaviors")
