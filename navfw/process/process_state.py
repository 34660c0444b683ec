"""What a plugin must leave as it was in its process: captured before, and compared after it.

Plugins share the process with the stack. What they change there would act on the robot, on later
runs, or on the result.
"""

from __future__ import annotations

import builtins
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numpy as np

_PACKAGE = "navfw."
_LIBRARIES = (
    *("math", "cmath", "json", "json.encoder", "json.decoder", "hashlib", "os", "os.path", "time"),
    *("struct", "random", "io", "signal", "threading", "subprocess", "pickle", "traceback"),
    *("numpy", "numpy.linalg", "numpy.random", "pybullet"),
)
"""Modules outside of navfw whose functions and classes are captured, besides the builtins."""

_MAX_NAMES = 3
"""Number of changed functions named in a message."""

_Entry = tuple[Any, str, object, object]
"""Owner, attribute, value, and the body of a Python function, or the value again."""


class CodeState:
    """The functions of navfw's modules, of the builtins and of some libraries, as they are now."""

    def __init__(self) -> None:
        self._builtins = dict(vars(builtins))
        self._entries: dict[str, _Entry] = {}
        self._modules: dict[str, ModuleType] = {}
        self.extend()

    def extend(self) -> None:
        """Add the functions of modules imported since."""
        modules = {
            name: module
            for name, module in list(sys.modules.items())
            if isinstance(module, ModuleType) and self._modules.get(name) is not module
        }
        self._modules |= modules
        self._entries |= _entries(modules)

    def restore(self) -> str:
        """Set back the functions that were replaced since; their names, "" if there are none.

        A function whose body was replaced counts, too. What was imported since and not added by
        ``extend`` is not known.
        """
        now = builtins.__dict__
        names = [
            f"builtins.{name}"
            for name, value in self._builtins.items()
            if now.get(name) is not value and name != "_"
        ]
        now.update(self._builtins)  # first: what follows needs them
        for name, (owner, attribute, value, body) in self._entries.items():
            current = vars(owner).get(attribute)
            if current is value and _body(current) is body:
                continue
            names.append(name)
            if isinstance(value, FunctionType):
                value.__code__ = body  # type: ignore[assignment]
            setattr(owner, attribute, value)
        more = f" and {len(names) - _MAX_NAMES} more" if len(names) > _MAX_NAMES else ""
        return ", ".join(names[:_MAX_NAMES]) + more


def _filters() -> tuple[Any, ...]:
    """The filters of all warnings of a builtin kind, whatever they say and where they are given.

    Libraries add some for texts or kinds of their own when they are imported, which may be late.
    """
    return tuple(
        (action, text, kind, module, line)
        for action, text, kind, module, line in warnings.filters
        if kind.__module__ == "builtins" and text is None and module is None
    )


def _set_filters(filters: tuple[Any, ...]) -> None:
    if (general := _filters()) != filters:
        others = (entry for entry in warnings.filters if entry not in general)
        warnings.filters[:] = (*others, *filters)  # type: ignore[index]


def _numpy_random() -> tuple[Any, ...]:
    name, keys, *rest = np.random.get_state(legacy=True)  # noqa: NPY002 - the global one
    return (name, tuple(np.asarray(keys).tolist()), *rest)


def _set_environment(variables: Mapping[str, str]) -> None:
    os.environ.clear()
    os.environ.update(variables)


_PARTS: tuple[tuple[str, Callable[[], Any], Callable[[Any], object]], ...] = (
    ("the working folder was changed", os.getcwd, os.chdir),
    ("the environment was changed", lambda: dict(os.environ), _set_environment),
    ("numpy's global generator was used", _numpy_random, np.random.set_state),
    ("the filters of warnings were changed", _filters, _set_filters),
)
"""What is said of a part that has changed, how it is read, and how it is set back."""


class ProcessState:
    """Working folder, environment, numpy's generator, warnings, threads, code: as now."""

    def __init__(self) -> None:
        self._values = [read() for _, read, _ in _PARTS]
        self._threads = frozenset(threading.enumerate())
        self.code = CodeState()

    def changes(self) -> list[str]:
        """What has changed since, each in a few words; the code apart (``CodeState.restore``)."""
        parts = zip(_PARTS, self._values, strict=True)
        changed = [what for (what, read, _), value in parts if read() != value]
        if threads := len(frozenset(threading.enumerate()) - self._threads):
            changed.append(f"{threads} thread{'s' * (threads != 1)} left running")
        return changed

    def restore(self) -> None:
        """Set back the working folder, the environment, numpy's generator and warnings."""
        for (_, _, write), value in zip(_PARTS, self._values, strict=True):
            write(value)


def _entries(modules: Mapping[str, ModuleType]) -> dict[str, _Entry]:
    """The functions of navfw's modules and classes and of ``_LIBRARIES``, by name."""
    own = [module for module in modules.values() if module.__name__.startswith(_PACKAGE)]
    libraries = [modules[name] for name in _LIBRARIES if name in modules]
    return {
        name: (owner, attribute, value, _body(value))
        for module, functions in (*((m, _own) for m in own), *((m, _all) for m in libraries))
        for name, owner, attribute, value in functions(module)
    }


def _body(value: object) -> object:
    return value.__code__ if isinstance(value, FunctionType) else value


def _own(module: ModuleType) -> Iterator[tuple[str, Any, str, object]]:
    """Functions and methods that ``module`` defines: name, owner, attribute, value."""
    for name, value in list(vars(module).items()):
        if isinstance(value, FunctionType):
            yield f"{module.__name__}.{name}", module, name, value
        elif isinstance(value, type) and value.__module__ == module.__name__:
            for attribute, method in list(vars(value).items()):
                if isinstance(method, FunctionType | property | classmethod | staticmethod):
                    yield f"{module.__name__}.{name}.{attribute}", value, attribute, method


def _all(module: ModuleType) -> Iterator[tuple[str, Any, str, object]]:
    """Functions and classes in ``module``."""
    for name, value in list(vars(module).items()):
        if isinstance(value, FunctionType | BuiltinFunctionType | type | np.ufunc):
            yield f"{module.__name__}.{name}", module, name, value
