"""Which kernels drives call, and with which types: the content of ``kernels.json``.

``uv run python tests/helpers/kernel_recording.py`` adds to the file what short drives call in
addition to what it lists.
"""

import importlib
import json
import sys
from collections.abc import Sequence
from typing import Any

from numba import types
from numba.extending import is_jitted

from navfw.config import list_files
from navfw.missions import prepare
from navfw.process import KERNEL_FILE

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


def calls_of_drives(stacks: Sequence[str], seconds: float) -> Calls:
    """What this process has called once it has driven with each of ``stacks`` for some time."""
    for stack in stacks:
        override = f"mission.timeout={seconds}"
        prepare("office", "lobby-to-lab", stack=stack, overrides=(override,)).run()
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
    """Add what drives of four simulated seconds call, with every stack that ships."""
    total = listed_calls()
    stacks = [stack.name for stack in list_files("stack") if stack.name != "navground"]
    for module, functions in calls_of_drives(stacks, 4.0).items():
        for name, signatures in functions.items():
            known = total.setdefault(module, {}).get(name, [])
            total[module][name] = sorted({*known, *signatures})
    ordered = {module: dict(sorted(total[module].items())) for module in sorted(total)}
    KERNEL_FILE.write_text(json.dumps(ordered, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
