"""What a plugin must leave as it was in its process, captured before a run and compared after it.

Plugins share the process with the stack. What they change there would act on the robot, on later
runs, or on the result: it becomes a fault of the result.
"""

from __future__ import annotations

import inspect
import os
import random
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from navfw.config.lookup import shipped_folder
from navfw.interfaces import Plugin
from navfw.missions.outcome import FaultKind, Outcome
from navfw.missions.runner import RunResult

_PACKAGE = "navfw."
_LIMIT = 3
"""Number of changed functions named in a message."""


@dataclass(frozen=True)
class ProcessState:
    """Working folder, environment, global random generators, warnings, threads, navfw's code."""

    folder: str
    environment: Mapping[str, str]
    random: object
    numpy_random: tuple[Any, ...]
    warnings: tuple[object, ...]
    threads: frozenset[threading.Thread]
    code: Mapping[str, object]

    @classmethod
    def capture(cls) -> ProcessState:
        """The state now."""
        return cls(
            folder=os.getcwd(),  # noqa: PTH109 - a text to compare
            environment=dict(os.environ),
            random=random.getstate(),
            numpy_random=_numpy_random(),
            warnings=_filters(),
            threads=frozenset(threading.enumerate()),
            code=_code(),
        )

    def changes(self) -> list[str]:
        """What has changed since, each in a few words; the code apart (``changed_code``)."""
        now = ProcessState.capture()
        threads = len(now.threads - self.threads)
        has_changed = {
            "the working folder was changed": now.folder != self.folder,
            "the environment was changed": now.environment != self.environment,
            "random's global generator was used": now.random != self.random,
            "numpy's global generator was used": now.numpy_random != self.numpy_random,
            "the filters of warnings were changed": now.warnings != self.warnings,
            f"{threads} thread{'s' * (threads != 1)} left running": threads > 0,
        }
        return [what for what, changed in has_changed.items() if changed]

    def changed_code(self) -> str:
        """Which functions of navfw were replaced since; "" if none."""
        now = _code()
        names = [name for name, value in self.code.items() if now.get(name) is not value]
        more = f" and {len(names) - _LIMIT} more" if len(names) > _LIMIT else ""
        return ", ".join(names[:_LIMIT]) + more

    def restore(self) -> None:
        """Set back the working folder, the environment, the generators and the warnings."""
        os.chdir(self.folder)
        os.environ.clear()
        os.environ.update(self.environment)
        random.setstate(self.random)  # type: ignore[arg-type]
        np.random.set_state(self.numpy_random)  # noqa: NPY002 - the global one
        if _filters() != self.warnings:
            warnings.filters[:] = self.warnings  # type: ignore[index]


def check_process(
    run: RunResult, before: ProcessState, plugins: Iterable[type[Plugin]]
) -> RunResult:
    """``run`` with the changes since ``before`` as faults; the process is set back.

    The faults name those ``plugins`` that do not ship with navfw. A run during which functions of
    navfw were replaced is a fault, whatever its outcome seems to be.
    """
    suspects = [f"{cls.kind} {cls.name}" for cls in plugins if not _ships(cls)]
    who = " or ".join(suspects) or "a plugin"
    faults = [f"{who}: {what}" for what in before.changes()]
    verdict = run.verdict
    if replaced := before.changed_code():
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


def _filters() -> tuple[object, ...]:
    """The filters of warnings in general.

    Libraries add some for categories of their own when they are imported, which may be late.
    """
    return tuple(entry for entry in warnings.filters if entry[2].__module__ == "builtins")


def _numpy_random() -> tuple[Any, ...]:
    name, keys, *rest = np.random.get_state(legacy=True)  # noqa: NPY002 - the global one
    return (name, tuple(np.asarray(keys).tolist()), *rest)


def _code() -> dict[str, object]:
    """The functions of navfw's modules and classes, by name; a replaced body counts, too."""
    return {
        name: value.__code__ if isinstance(value, FunctionType) else value
        for module in list(sys.modules.values())
        if isinstance(module, ModuleType) and module.__name__.startswith(_PACKAGE)
        for name, value in _functions(module)
    }


def _functions(module: ModuleType) -> Iterator[tuple[str, object]]:
    """Functions and methods that ``module`` defines, with their names."""
    for name, value in list(vars(module).items()):
        if isinstance(value, FunctionType):
            yield f"{module.__name__}.{name}", value
        elif isinstance(value, type) and value.__module__ == module.__name__:
            for attribute, method in list(vars(value).items()):
                if isinstance(method, FunctionType | property | classmethod | staticmethod):
                    yield f"{module.__name__}.{name}.{attribute}", method
