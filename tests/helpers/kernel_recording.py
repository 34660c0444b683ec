"""Which kernels drives call, and with which types: the content of ``kernels.json``.

``uv run python tests/helpers/kernel_recording.py`` adds to the file what short drives call in
addition to what it lists.
"""

import importlib
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from numba import types
from numba.extending import is_jitted

from navfw.config import list_files
from navfw.missions import prepare
from navfw.missions.session import Session
from navfw.plugins import default_registry
from navfw.process.kernel_compilation import KERNEL_FILE
from navfw.suite import load_suite
from navfw.suite.suite_plan import plan_runs

STACKS = [stack.name for stack in list_files("stack") if stack.name != "navground"]
"""The stacks that ship; navground needs its library."""

Calls = dict[str, dict[str, list[str]]]
"""Module: function: its signatures."""


def expression(kind: Any) -> str:
    """A type in the words of ``numba.types``, as ``parse_types`` reads it."""
    if isinstance(kind, types.Array):
        readonly = "" if kind.mutable else ", readonly=True"
        return f"Array({expression(kind.dtype)}, {kind.ndim}, {kind.layout!r}{readonly})"
    if isinstance(kind, types.UniTuple):
        return f"UniTuple({expression(kind.dtype)}, {kind.count})"
    if isinstance(kind, types.Tuple):
        return f"Tuple(({', '.join(map(expression, kind))}))"
    return "boolean" if kind == types.boolean else str(kind)


NOT_DRIVEN = ("ablations", "barn", "bodies", "faults")
"""Suites whose worlds are those of others, or elsewhere."""


def drives(seconds: float, suites: Sequence[str] | None = None) -> Iterator[Session]:
    """Drives with all stacks, with all robots, and of one seed of the ``suites`` that ship."""
    shorter, registry = f"mission.timeout={seconds}", default_registry()
    for stack in STACKS:
        yield prepare("office", "lobby-to-lab", stack=stack, overrides=(shorter,))
    for robot in list_files("robot"):
        yield prepare("office", "lobby-to-lab", overrides=(shorter, f"robot={robot.name}"))
    for suite in suites or [file.name for file in list_files("suite")]:
        if suite not in NOT_DRIVEN:
            plan = plan_runs(load_suite(suite), range(1), registry, overrides=(shorter,))
            yield from (case.session(registry) for case in plan.cases)


def calls_of_drives(sessions: Iterable[Session]) -> Calls:
    """What this process has called once it has driven each of the ``sessions``."""
    for session in sessions:
        session.run()
    found: Calls = {}
    for module in sorted(name for name in sys.modules if name.startswith("navfw.")):
        for name, function in sorted(vars(sys.modules[module]).items()):
            if is_jitted(function) and function.py_func.__module__ == module:
                signatures = sorted(", ".join(map(expression, s)) for s in function.signatures)
                if signatures:
                    found.setdefault(module, {})[name] = signatures
    return found


def listed_calls() -> Calls:
    """The content of ``kernels.json``; a function that no longer exists is left out."""
    listed: Calls = json.loads(KERNEL_FILE.read_text(encoding="utf-8"))
    return {
        module: {
            name: signatures
            for name, signatures in functions.items()
            if hasattr(importlib.import_module(module), name)
        }
        for module, functions in listed.items()
    }


def main() -> None:
    """Add what ``drives`` of some simulated seconds call, some hundred of them."""
    total = listed_calls()
    for module, functions in calls_of_drives(drives(8.0)).items():
        for name, signatures in functions.items():
            known = total.setdefault(module, {}).get(name, [])
            total[module][name] = sorted({*known, *signatures})
    ordered = {module: dict(sorted(total[module].items())) for module in sorted(total)}
    KERNEL_FILE.write_text(json.dumps(ordered, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
