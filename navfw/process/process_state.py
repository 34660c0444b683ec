"""What a plugin must leave as it was in its process: captured before, and compared after it.

Plugins share the process with the stack. What they change there would act on the robot, on later
runs, or on the result.
"""

from __future__ import annotations

import builtins
import os
import random
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
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


@dataclass(frozen=True)
class ProcessState:
    """Working folder, environment, random generators, warnings, streams, threads, and code."""

    folder: str
    environment: Mapping[str, str]
    random: object
    numpy_random: tuple[Any, ...]
    warnings: tuple[object, ...]
    streams: tuple[Any, Any]
    threads: frozenset[threading.Thread]
    code: CodeState

    @classmethod
    def capture(cls) -> ProcessState:
        """The state now."""
        return cls(
            folder=os.getcwd(),  # noqa: PTH109 - a text to compare
            environment=dict(os.environ),
            random=random.getstate(),
            numpy_random=_numpy_random(),
            warnings=_filters(),
            streams=(sys.stdout, sys.stderr),
            threads=frozenset(threading.enumerate()),
            code=CodeState(),
        )

    def changes(self) -> list[str]:
        """What has changed since, each in a few words; the code apart (``CodeState.restore``)."""
        threads = len(frozenset(threading.enumerate()) - self.threads)
        has_changed = {
            "the working folder was changed": os.getcwd() != self.folder,  # noqa: PTH109
            "the environment was changed": dict(os.environ) != self.environment,
            "random's global generator was used": random.getstate() != self.random,
            "numpy's global generator was used": _numpy_random() != self.numpy_random,
            "the filters of warnings were changed": _filters() != self.warnings,
            "the standard streams were replaced": (sys.stdout, sys.stderr) != self.streams,
            f"{threads} thread{'s' * (threads != 1)} left running": threads > 0,
        }
        return [what for what, changed in has_changed.items() if changed]

    def restore(self) -> None:
        """Set back the working folder, the environment, generators, warnings and streams."""
        os.chdir(self.folder)
        os.environ.clear()
        os.environ.update(self.environment)
        random.setstate(self.random)  # type: ignore[arg-type]
        np.random.set_state(self.numpy_random)  # noqa: NPY002 - the global one
        sys.stdout, sys.stderr = self.streams
        if _filters() != self.warnings:
            warnings.filters[:] = self.warnings  # type: ignore[index]


def _filters() -> tuple[object, ...]:
    """The filters of warnings in general.

    Libraries add some for categories of their own when they are imported, which may be late.
    """
    return tuple(entry for entry in warnings.filters if entry[2].__module__ == "builtins")


def _numpy_random() -> tuple[Any, ...]:
    name, keys, *rest = np.random.get_state(legacy=True)  # noqa: NPY002 - the global one
    return (name, tuple(np.asarray(keys).tolist()), *rest)


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
