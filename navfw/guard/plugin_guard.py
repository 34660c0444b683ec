"""Calls plugins within a time limit, checks answers, and contains and records failures."""

from __future__ import annotations

import sysconfig
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from navfw.config.input_file import shown_path
from navfw.errors import InputError, NavfwError, PluginError, described
from navfw.guard.answers import AnswerError, instance
from navfw.interfaces import Plugin
from navfw.process.interruption import check_interrupted
from navfw.process.watchdog import PluginTimeout, Watchdog
from navfw.robot import RobotModel

_FRAMES = 50  # chosen
"""Number of calls, from the innermost outwards, that are searched for the plugin's own code."""

_GUARD, _PACKAGE = Path(__file__).parents[:2]
_LIBRARIES = tuple(
    f"{Path(sysconfig.get_path(name))}/" for name in ("stdlib", "platstdlib", "purelib", "platlib")
)


def fault_origin(error: BaseException) -> str:
    """Return the innermost call in the plugin's own code, as in ``hover.py:12, in propose: 1 / 0``.

    If all calls are in navfw and libraries, it is the innermost call outside of ``navfw.guard``; ""
    if there is none, as when a check refuses an answer.
    """
    frames = traceback.extract_tb(error.__traceback__, limit=-_FRAMES)
    outside = [frame for frame in frames if not Path(frame.filename).is_relative_to(_GUARD)]
    own = [frame for frame in outside if _is_own(frame.filename)]
    if not outside:
        return ""
    frame = (own or outside)[-1]
    text = f": {frame.line.strip()}" if frame.line else ""
    return f"{shown_path(Path(frame.filename))}:{frame.lineno}, in {frame.name}{text}"


def _is_own(file: str) -> bool:
    """Whether a file is neither navfw's package nor a library; what ships as a plugin is own."""
    path = Path(file)
    if path.is_relative_to(_PACKAGE):
        return path.is_relative_to(_PACKAGE / "shipped")
    return not file.startswith(_LIBRARIES) and not file.startswith("<")


FIRST_LIMIT = 60.0  # chosen
"""Wall time limit of a plugin's first call in a run [s], and of all up to the first decision: they
may load kernels and libraries."""

LIMIT = 10.0  # chosen
"""Wall time limit of every other call [s]: some ten thousand times the usual run time."""

SUSPENSION, MAX_SUSPENSION = 0.5, 16.0  # chosen
"""Simulated time [s] for which a plugin is not called after its first time-out, doubled each time,
and its bound."""

MAX_FAILURE_RATE = 0.1  # chosen
"""Share of its calls in which a plugin may fail before the run counts as failed."""

_MAX_ERROR = 300  # chosen
"""Largest length of the error text of a fault [characters]."""

_MAX_FAULTS = 100  # chosen
"""Largest number of distinct faults kept: a plugin may raise a new error at every call."""

AnswerT = TypeVar("AnswerT")
PluginT = TypeVar("PluginT", bound=Plugin)


def label_of(plugin: Plugin) -> str:
    """Return kind and name of ``plugin``, its label in faults."""
    return f"{plugin.kind} {plugin.name}"


class PluginCallError(NavfwError):
    """A call of a plugin gave no valid answer. The failure is in the guard's ``faults``."""


@dataclass(frozen=True, slots=True)
class PluginFault:
    """An error of a plugin, which occurred first at ``time`` [s], ``count`` times in total."""

    time: float
    plugin: str
    error: str
    count: int = 1

    def __str__(self) -> str:
        times = "once" if self.count == 1 else f"{self.count} times"
        return f"{self.plugin}: {self.error} ({times}, first at {self.time:.1f} s)"


@dataclass(frozen=True, slots=True)
class FailingStage:
    """A stage without which the robot cannot drive; it has failed ``since`` [s] with ``error``."""

    plugin: str
    since: float
    error: str


class PluginGuard:
    """Calls plugins on behalf of the stack.

    A call fails if the plugin raises anything (SystemExit and KeyboardInterrupt included), exceeds
    the time limit, or gives an answer that its check refuses. The failure is recorded in ``faults``
    and PluginCallError is raised. After a time-out the plugin is suspended for some simulated time.
    ``failing`` has the stages, by plugin, whose last ``vital`` call has failed. While ``starting``,
    a plugin may refuse the mission by an InputError. ``watchdog`` enforces the limits.
    """

    def __init__(self, limit: float = LIMIT, first_limit: float = FIRST_LIMIT) -> None:
        self._limit = limit
        self._first_limit = first_limit
        self.watchdog = Watchdog()
        self.reset()

    def reset(self) -> None:
        """Return to the start of a run: no faults, no plugin suspended."""
        self.time = 0.0
        self.starting = True
        self._answered: Counter[str] = Counter()
        self._failed: Counter[str] = Counter()
        self._suspended: dict[str, tuple[float, float]] = {}
        self._faults: dict[tuple[str, str], PluginFault] = {}
        self.failing: dict[str, FailingStage] = {}

    @property
    def faults(self) -> tuple[PluginFault, ...]:
        """Errors of plugins in this run, each distinct error once, oldest first."""
        return tuple(self._faults.values())

    @property
    def unreliable(self) -> Mapping[str, str]:
        """A message, by plugin, for each that failed in more than a tenth of its calls."""
        calls = {plugin: failed + self._answered[plugin] for plugin, failed in self._failed.items()}
        return {
            plugin: f"{plugin} failed in {self._failed[plugin]} of {count} calls"
            for plugin, count in calls.items()
            if self._failed[plugin] > MAX_FAILURE_RATE * count
        }

    def call(
        self,
        plugin: str,
        function: Callable[..., Any],
        *arguments: Any,
        check: Callable[[Any], AnswerT],
        vital: bool = False,
    ) -> AnswerT:
        """Call ``function(*arguments)`` of ``plugin``; return its answer as ``check`` accepts it.

        Raises:
            PluginCallError: there is no valid answer, or the plugin is suspended.
            KeyboardInterrupt: the user has interrupted the run.
            InputError: the plugin refuses the mission at its start.

        """
        suspended = self._suspended.get(plugin)
        if suspended is not None and self.time < suspended[0]:
            self._failed[plugin] += 1
            raise PluginCallError("suspended after a time-out")
        try:
            first = self.starting or not self._answered[plugin]
            self.watchdog.begin(self._first_limit if first else self._limit)
            try:
                answer = check(function(*arguments))
            finally:
                self.watchdog.end()
        except BaseException as error:  # SystemExit, too: a plugin must not end the run
            check_interrupted(error)
            if isinstance(error, InputError) and self.starting:
                raise  # the plugin refuses the mission
            if isinstance(error, PluginTimeout):  # it rests, each time for twice as long
                _, before = self._suspended.get(plugin, (0.0, 0.5 * SUSPENSION))
                duration = min(2.0 * before, MAX_SUSPENSION)
                self._suspended[plugin] = (self.time + duration, duration)
            raise self._failure(plugin, error_text(error), vital) from None
        self._answered[plugin] += 1
        if vital:
            self.failing.pop(plugin, None)
        return answer

    def attempt(
        self, *call: Any, check: Callable[[Any], AnswerT], vital: bool = False
    ) -> AnswerT | None:
        """Call as ``call`` does, with the same arguments; return None if the plugin fails."""
        try:
            return self.call(*call, check=check, vital=vital)
        except PluginCallError:
            return None

    def _failure(self, plugin: str, error: str, vital: bool) -> PluginCallError:
        self._failed[plugin] += 1
        if vital and plugin not in self.failing:
            self.failing[plugin] = FailingStage(plugin, self.time, error)
        fault = self._faults.get((plugin, error))
        if fault is not None:
            self._faults[plugin, error] = replace(fault, count=fault.count + 1)
        elif len(self._faults) < _MAX_FAULTS:
            self._faults[plugin, error] = PluginFault(self.time, plugin, error)
        return PluginCallError(f"{plugin}: {error}")


@contextmanager
def contained(plugin: str, *passed: type[Exception]) -> Iterator[None]:
    """Context of a plugin call outside of a run, within ``FIRST_LIMIT``.

    Raises:
        PluginError: it failed; an InputError, and those of ``passed``, are raised unchanged.

    """
    watchdog = Watchdog()
    meant: tuple[type[Exception], ...] = (InputError, *passed)
    with watchdog.on_duty():
        watchdog.begin(FIRST_LIMIT)
        try:
            yield
        except meant:
            raise
        except BaseException as error:
            check_interrupted(error)
            raise PluginError(error_text(error), key=plugin) from None
        finally:
            watchdog.end()


def construct(
    cls: type[PluginT], robot: RobotModel, params: Plugin.Params | None = None
) -> PluginT:
    """Make an instance of a plugin class.

    Raises:
        PluginError: its constructor fails.

    """
    with contained(f"{cls.kind} {cls.name}"):
        return instance(cls(robot, params), cls, "the class")


def error_text(error: BaseException) -> str:
    """Type and message of ``error`` on one line, shortened, and its origin in the plugin's code."""
    if isinstance(error, PluginTimeout):
        text = f"took too long: {error}"
    else:
        text = ": ".join(part for part in described(error) if part)
    short = text if len(text) <= _MAX_ERROR else f"{text[:_MAX_ERROR]}..."
    origin = "" if isinstance(error, AnswerError) else fault_origin(error)
    return f"{short} ({origin})" if origin else short
