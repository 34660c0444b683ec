"""Which plugins use the simulator, whose truth no robot has: by their source, and in a run.

Plugins are trusted code: nothing keeps one from reading the true pose. What is found here marks the
result of a run, and keeps nobody from hiding it on purpose.
"""

from __future__ import annotations

import ast
import builtins
import functools
import importlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

from navfw.config.input_file import read_input, shown_path
from navfw.errors import ConfigError
from navfw.interfaces import Plugin
from navfw.plugins.verification import source_file

_MAX_SOURCE = 5_000_000
"""Largest size of a plugin's source [byte]."""

_SIMULATOR = ("pybullet", "pybullet_data", "pybullet_utils", "navfw.sim", "navfw.missions")
"""The modules, with all below them, from which the simulator's truth can be had."""

_BY_A_DETOUR = {
    "sys": {"modules", "_getframe", "_current_frames"},
    "gc": {"get_objects", "get_referrers", "get_referents"},
    "inspect": {"currentframe", "stack"},
}
_OF_WORLDS = {"landmark", "event", "family"}
_MAX_OBJECTS = 5000
"""Number of objects looked at in one plugin."""


@dataclass(frozen=True, slots=True)
class SourceFinding:
    """``what`` a plugin's source does at ``line``; ``uses``: it is the simulator without doubt."""

    line: int
    what: str
    uses: bool


def source_findings(file: Path) -> tuple[SourceFinding, ...]:
    """Where the Python source ``file`` uses the simulator, or could get at it by a detour.

    Used are imports, and texts that name a module of ``_SIMULATOR``, as in ``sys.modules["..."]``.
    Detours are access to all modules, objects or frames of the interpreter, and ``ctypes``. A file
    that cannot be read or parsed has no findings.
    """
    try:
        changed = file.stat().st_mtime_ns
    except OSError:
        return ()
    return _findings(file, changed)


def access_notes(cls: type[Plugin]) -> list[str]:
    """A line ``file:line: what`` for each of the ``source_findings`` of a stage's plugin.

    Landmark kinds, events and families of worlds act on the world before a run: theirs are none.
    """
    file = source_file(cls)
    if file is None or cls.kind in _OF_WORLDS:
        return []
    findings = source_findings(file)
    return [f"{shown_path(file)}:{finding.line}: {finding.what}" for finding in findings]


@functools.lru_cache(maxsize=512)
def _findings(file: Path, changed: int) -> tuple[SourceFinding, ...]:
    """``source_findings`` of the file as ``changed`` last [ns]."""
    del changed
    try:
        tree = ast.parse(read_input(file, _MAX_SOURCE))
    except (ConfigError, SyntaxError, ValueError, RecursionError):
        return ()
    findings = [finding for node in ast.walk(tree) for finding in _findings_at(node)]
    return tuple(sorted(findings, key=lambda finding: finding.line))


def _findings_at(node: ast.AST) -> Iterator[SourceFinding]:
    match node:
        case ast.Import(names=names):
            yield from _imports(node.lineno, [name.name for name in names])
        case ast.ImportFrom(module=str(module), names=names, level=0):
            yield from _imports(node.lineno, [module, *(f"{module}.{n.name}" for n in names)])
        case ast.Constant(value=str(text)) if _is_simulator(text):
            yield SourceFinding(node.lineno, f"names the module {text}", uses=True)
        case ast.Attribute(value=ast.Name(id=str(owner)), attr=attr):
            if attr in _BY_A_DETOUR.get(owner, ()):
                yield SourceFinding(node.lineno, f"reads {owner}.{attr}", uses=False)


def _imports(line: int, names: list[str]) -> Iterator[SourceFinding]:
    simulator = [name for name in names if _is_simulator(name)]
    if simulator:
        yield SourceFinding(line, f"imports {simulator[0]}", uses=True)
    for name in names:
        module, _, attribute = name.rpartition(".")
        if name == "ctypes" or attribute in _BY_A_DETOUR.get(module, ()):
            yield SourceFinding(line, f"imports {name}", uses=False)


def _is_simulator(name: object) -> bool:
    return isinstance(name, str) and any(
        name == module or name.startswith(f"{module}.") for module in _SIMULATOR
    )


class SimulatorWatch:
    """Finds out which of ``plugins``, by name, use the simulator in a run.

    Within the context imports are watched: one of a module of ``_SIMULATOR`` counts for the plugin
    whose file is nearest on the stack of calls. ``found`` adds what the plugins' sources say, and
    what the plugins and their modules hold at the end.
    """

    def __init__(self, plugins: Mapping[str, Plugin]) -> None:
        self._plugins = dict(plugins)
        self._files: dict[Path, list[str]] = {}
        for name, plugin in self._plugins.items():
            file = source_file(type(plugin))
            if file is not None:
                self._files.setdefault(file.resolve(), []).append(name)
        self._importing: set[str] = set()

    def __enter__(self) -> SimulatorWatch:
        """Begin to watch imports."""
        self._import = builtins.__import__
        self._import_module = importlib.import_module
        builtins.__import__ = self._watched_import
        importlib.import_module = self._watched_import_module
        return self

    def __exit__(self, *exception: object) -> None:
        """Imports are no longer watched."""
        builtins.__import__ = self._import
        importlib.import_module = self._import_module

    def found(self) -> tuple[str, ...]:
        """The names of the plugins that use the simulator, sorted; declared ones are among them."""
        names = self._importing | {n for n, plugin in self._plugins.items() if plugin.oracle}
        for file, owners in self._files.items():
            if any(finding.uses for finding in source_findings(file)):
                names.update(owners)
        names.update(name for name, plugin in self._plugins.items() if _holds_simulator(plugin))
        return tuple(sorted(names))

    def _watched_import(
        self,
        name: str,
        globals: Mapping[str, object] | None = None,  # noqa: A002 - as Python calls it
        locals: Mapping[str, object] | None = None,  # noqa: A002
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> ModuleType:
        wanted = [name, *(f"{name}.{part}" for part in fromlist or ())]
        if level == 0 and any(map(_is_simulator, wanted)):
            self._note(sys._getframe(1))
        return self._import(name, globals, locals, fromlist or (), level)

    def _watched_import_module(self, name: str, package: str | None = None) -> ModuleType:
        if _is_simulator(name):
            self._note(sys._getframe(1))
        return self._import_module(name, package)

    def _note(self, caller: FrameType | None) -> None:
        """Count an import for the plugins of the nearest file on the stack; none: navfw's own."""
        while caller is not None:
            owners = self._files.get(Path(caller.f_code.co_filename).resolve())
            if owners is not None:
                self._importing.update(owners)
                return
            caller = caller.f_back


def _holds_simulator(plugin: Plugin) -> bool:
    """Whether the simulator is within ``plugin``, or within the modules it is written in."""
    module = sys.modules.get(type(plugin).__module__)
    package = type(plugin).__module__.partition(".")[0]
    own = "" if package == "navfw" else package
    waiting: list[Any] = [vars(plugin), {} if module is None else vars(module)]
    seen: set[int] = set()
    while waiting and len(seen) < _MAX_OBJECTS:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if _is_simulator(_module_of(value)):
            return True
        waiting.extend(_parts_of(value, own))
    return False


def _module_of(value: object) -> object:
    """The name of a module; else of the module that defines a class, function or instance."""
    if isinstance(value, ModuleType):
        return value.__name__
    if callable(value) and isinstance(getattr(value, "__module__", None), str):
        return value.__module__
    return type(value).__module__


def _parts_of(value: object, package: str) -> Iterator[object]:
    """What ``value`` holds: items, attributes, and the variables of modules of ``package``."""
    if isinstance(value, dict):
        yield from value.values()
    elif isinstance(value, list | tuple | set | frozenset):
        yield from value
    elif isinstance(value, ModuleType):
        if package and value.__name__.partition(".")[0] == package:
            yield vars(value)
    elif isinstance(value, type) or callable(value):
        module = sys.modules.get(getattr(value, "__module__", None) or "")
        if module is not None:
            yield module
    elif hasattr(value, "__dict__"):
        yield vars(value)
