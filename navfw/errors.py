"""The exceptions of navfw.

NavfwError
├── InputError            a file, name or option is wrong; `navfw` exits with 2
│   ├── ConfigError       a data file breaks its schema; names file, line, key, expected value
│   ├── UnknownNameError  a world, mission, map, stack, plugin or place of that name does not exist
│   ├── PluginError       a plugin cannot be used: wrong base, signature, name or parameters
│   │   └── MissingExtraError  it needs an optional extra of navfw that is not installed
│   ├── UntrustedCodeError    the project's plugins may not be executed; says how to allow it
│   ├── RuleBaseError     a fuzzy rule base is malformed or leaves inputs uncovered
│   ├── WorldError        a world or mission is impossible: start in a wall, goal unreachable
│   └── MapError          a topological map is inconsistent
└── SimulationError       the simulator failed; `navfw` exits with 1
"""

from __future__ import annotations

import difflib
import operator
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

_NEAR = 0.52
"""Least similarity of a name that is meant: "bride" and "bright" have 0.55, "latency" and
"emergency" 0.5."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint for an error message: the nearest known name or, if none is near, all names."""
    names = sorted(set(known))
    near = difflib.get_close_matches(name, names, n=1, cutoff=_NEAR)
    if near:
        return f"did you mean {near[0]!r}?"
    if names:
        return "known: " + ", ".join(names)
    return "none is known"


def described(error: BaseException) -> tuple[str, str]:
    """Return the name of the class of ``error``, and its message on one line."""
    try:
        message = " ".join(str(error).split())
    except Exception as second:
        message = f"its message raises {type(second).__name__}"
    return type(error).__name__, message


class NavfwError(Exception):
    """Base class of navfw's exceptions."""


class InputError(NavfwError):
    """A file, name or option is wrong; the message gives the place, the problem and the remedy.

    ``file``, ``line`` (1-based) and ``key`` are the place, as far as known; the message begins with
    them.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | Path | None = None,
        line: int | None = None,
        key: str | None = None,
    ) -> None:
        super().__init__(message)
        self._place(file, line, key)

    def located(
        self, *, file: str | Path | None = None, line: int | None = None, key: str | None = None
    ) -> Self:
        """Return a copy of this error whose message begins with the given place, then its own."""
        located = type(self).__new__(type(self), str(self))
        located.__dict__.update(self.__dict__)
        located._place(file, line, key)
        return located

    def _place(self, file: str | Path | None, line: int | None, key: str | None) -> None:
        self.file = None if file is None else str(file)
        self.line = line
        self.key = key
        where = self.file or ""
        if line is not None:
            where += f":{line}" if where else f"line {line}"
        self.args = (": ".join([*(part for part in (where, key) if part), str(self)]),)


MAX_SEED = 2**63 - 1
"""Largest seed."""


def checked_seed(seed: object) -> int:
    """Check that ``seed`` is a whole number from 0 to ``MAX_SEED``, and return it as an int.

    Raises:
        InputError: it is not; None is refused, too, as it would give other numbers each time.

    """
    number = seed if not isinstance(seed, bool) and hasattr(seed, "__index__") else -1
    if not 0 <= operator.index(number) <= MAX_SEED:
        what = f"expected a seed from 0 to {MAX_SEED}, a whole number; got {seed!r:.40}"
        raise InputError(what, key="seed")
    return operator.index(number)


class ConfigError(InputError):
    """A data file breaks its schema."""


class UnknownNameError(InputError):
    """No world, mission, map, stack, plugin or place has the given name."""

    def __init__(
        self,
        what: str,
        name: str,
        known: Iterable[str],
        *,
        file: str | Path | None = None,
        line: int | None = None,
        key: str | None = None,
    ) -> None:
        self.what = what
        self.name = name
        self.known = sorted(set(known))
        super().__init__(
            f"unknown {what} {name!r}: {did_you_mean(name, self.known)}",
            file=file,
            line=line,
            key=key,
        )


class PluginError(InputError):
    """A plugin cannot be used: wrong base class, missing method, signature, name or parameters."""


class MissingExtraError(PluginError):
    """A plugin, a command or an option needs an optional extra of navfw that is not installed."""

    def __init__(
        self, extra: str, module: str, *, file: str | Path | None = None, key: str | None = None
    ) -> None:
        self.extra = extra
        super().__init__(
            f"needs {module}, which is not installed: pip install 'navfw[{extra}]', or in a clone"
            f" uv sync --extra {extra}",
            file=file,
            key=key,
        )


class UntrustedCodeError(InputError):
    """The project has plugins, and the user has not agreed to execute them."""


class RuleBaseError(InputError):
    """A fuzzy rule base is malformed or leaves a region of its inputs uncovered."""


class WorldError(InputError):
    """A world or mission is impossible: start inside a wall, goal unreachable, bad geometry."""


class MapError(InputError):
    """A topological map is inconsistent."""


class SimulationError(NavfwError):
    """The simulator failed, independently of the input."""


@contextmanager
def locating(
    *,
    file: str | Path | None = None,
    line: int | None = None,
    key: str | None = None,
    only: type[InputError] = InputError,
) -> Iterator[None]:
    """Put a place before that of each error raised in the block, if it is of the class ``only``."""
    try:
        yield
    except only as error:
        raise error.located(file=file, line=line, key=key) from None
