"""Which plugins use the simulator, whose truth no robot has: by their source, and in a run.

Plugins are trusted code: nothing keeps one from reading the true pose. What is found here marks the
result of a run, and keeps nobody from hiding it on purpose.
"""

from __future__ import annotations

import ast
import functools
import itertools
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, ClassVar

from navfw.config.input_file import read_input, real_path, shown_path
from navfw.errors import ConfigError
from navfw.interfaces import Plugin
from navfw.plugins.verification import source_file

_MAX_SOURCE = 5_000_000
"""Largest size of a plugin's source [byte]."""

_SIMULATOR = ("pybullet", "pybullet_data", "pybullet_utils", "navfw.sim", "navfw.missions")
"""The modules, with all below them, from which the simulator's truth can be had."""

_OBJECTS_AND_FRAMES = {
    "sys": {"_getframe", "_current_frames", "settrace", "setprofile", "addaudithook"},
    "gc": {"get_objects", "get_referrers", "get_referents"},
    "inspect": {"currentframe", "stack", "trace", "getouterframes"},
    "threading": {"settrace", "setprofile"},
}
"""What gives access to objects and frames of the whole process, by module."""

_INNER = {"f_back", "f_locals", "f_globals", "tb_frame", "gi_frame", "cr_frame"}
_INNER |= {"__globals__", "__closure__", "__subclasses__", "__builtins__"}
"""Attributes that do so."""

_RUNNING = {"__import__", "import_module", "exec", "eval", "compile"}
"""Functions that run what a reader of the source cannot see; but for imports of a written name."""

_AUDITED = (
    *("sys._getframe", "sys._current_frames", "sys.settrace", "sys.setprofile"),
    *("gc.get_objects", "gc.get_referrers", "gc.get_referents", "object.__getattr__", "ctypes."),
)
"""Beginnings of the interpreter's audit events that count where a plugin causes them itself."""

_PASSED = ("inspect", "ctypes", "importlib")
"""Libraries that a plugin may cause an event through."""

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

    Used are imports, and texts that name a module of ``_SIMULATOR``; and, as nobody can see what
    they lead to, computed imports, code made from text, and access to objects and frames of the
    whole process. Detours are ``sys.modules`` and ``ctypes``. A file that cannot be read or parsed
    has no findings.
    """
    return _read(file)[0]


def access_notes(cls: type[Plugin]) -> list[str]:
    """A line ``file:line: what`` for each of the ``source_findings`` of a stage's plugin.

    Landmark kinds, events and families of worlds act on the world before a run, and an oracle says
    what it is: theirs are none.
    """
    file = source_file(cls)
    if file is None or cls.kind in _OF_WORLDS or getattr(cls, "oracle", False):
        return []
    findings = source_findings(file)
    return [f"{shown_path(file)}:{finding.line}: {finding.what}" for finding in findings]


_Findings = tuple[tuple[SourceFinding, ...], tuple[Path, ...]]
"""``source_findings`` of a file, and the helpers that it imports."""


def _read(file: Path) -> _Findings:
    try:
        return _findings(file, file.stat().st_mtime_ns)
    except OSError:
        return (), ()


@functools.lru_cache(maxsize=512)
def _findings(file: Path, _changed: int) -> _Findings:
    try:
        tree = ast.parse(read_input(file, _MAX_SOURCE))
    except (ConfigError, SyntaxError, ValueError, RecursionError):
        return (), ()
    nodes = list(ast.walk(tree))
    findings = [finding for node in nodes for finding in _findings_at(node)]
    beside = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.level == 1]
    names = [[node.module] if node.module else [n.name for n in node.names] for node in beside]
    helpers = {file.parent / f"{name}.py" for name in itertools.chain(*names)} - {file}
    return tuple(sorted(findings, key=lambda finding: finding.line)), tuple(sorted(helpers))


def _uses(file: Path, seen: set[Path]) -> bool:
    """Whether ``file``, or a helper in its folder, uses the simulator by its source."""
    seen.add(file)
    findings, helpers = _read(file)
    if any(finding.uses for finding in findings):
        return True
    return any(_uses(helper, seen) for helper in helpers if helper not in seen)


def _findings_at(node: ast.AST) -> Iterator[SourceFinding]:
    match node:
        case ast.Import(names=names):
            yield from _imports(node.lineno, [name.name for name in names])
        case ast.ImportFrom(module=str(module), names=names, level=0):
            yield from _imports(node.lineno, [module, *(f"{module}.{n.name}" for n in names)])
        case ast.Constant(value=str(text)) if _is_simulator(text):
            yield SourceFinding(node.lineno, f"names the module {text}", uses=True)
        case ast.Call(
            func=ast.Name(id=name) | ast.Attribute(attr="import_module" as name), args=[first, *_]
        ) if name in _RUNNING and (name in {"exec", "eval"} or not _is_text(first)):
            yield SourceFinding(node.lineno, f"calls {name}", uses=True)
        case ast.Subscript(value=ast.Attribute(attr="modules"), slice=key) if not _is_text(key):
            yield SourceFinding(node.lineno, "reads a module of a computed name", uses=True)
        case ast.Attribute(value=ast.Name(id=str(owner)), attr=attr):
            uses = attr in _OBJECTS_AND_FRAMES.get(owner, ()) or attr in _INNER
            if uses or (owner, attr) == ("sys", "modules"):
                yield SourceFinding(node.lineno, f"reads {owner}.{attr}", uses=uses)
        case ast.Attribute(attr=attr) if attr in _INNER:
            yield SourceFinding(node.lineno, f"reads {attr}", uses=True)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _imports(line: int, names: list[str]) -> Iterator[SourceFinding]:
    simulator = [name for name in names if _is_simulator(name)]
    if simulator:
        yield SourceFinding(line, f"imports {simulator[0]}", uses=True)
    for name in names:
        module, _, attribute = name.rpartition(".")
        uses = attribute in _OBJECTS_AND_FRAMES.get(module, ())
        if uses or name in {"ctypes", "sys.modules"}:
            yield SourceFinding(line, f"imports {name}", uses=uses)


def _is_simulator(name: object) -> bool:
    return isinstance(name, str) and any(
        name == module or name.startswith(f"{module}.") for module in _SIMULATOR
    )


class SimulatorWatch:
    """Finds out which of ``plugins``, by name, use the simulator in a run.

    Within the context, an audit hook of the interpreter counts access to objects and frames of the
    whole process for the plugin whose code asks for it. ``found`` adds what the sources of plugins,
    and of helpers in their folders, say, and what plugins and their modules hold at the end.
    """

    _watching: ClassVar[SimulatorWatch | None] = None

    def __init__(self, plugins: Mapping[str, Plugin]) -> None:
        self._plugins = dict(plugins)
        self._files: dict[Path, list[str]] = {}
        for name, plugin in self._plugins.items():
            file = source_file(type(plugin))
            if file is not None:
                self._files.setdefault(real_path(file), []).append(name)
        self._folders = {file.parent for file in self._files}
        self._asking: set[str] = set()

    def __enter__(self) -> SimulatorWatch:
        """Begin to watch."""
        _add_hook()
        SimulatorWatch._watching = self
        return self

    def __exit__(self, *exception: object) -> None:
        """No longer watch."""
        SimulatorWatch._watching = None

    def found(self) -> tuple[str, ...]:
        """The names of the plugins that use the simulator, sorted; declared ones are among them."""
        names = self._asking | {n for n, plugin in self._plugins.items() if plugin.oracle}
        for file, owners in self._files.items():
            if _uses(file, set()):
                names.update(owners)
        names.update(name for name, plugin in self._plugins.items() if _holds_simulator(plugin))
        return tuple(sorted(names))

    @classmethod
    def _take(cls, event: str, _: tuple[Any, ...]) -> None:
        watch = cls._watching
        if watch is None or not event.startswith(_AUDITED):
            return
        cls._watching = None  # what follows causes events, too
        try:
            watch._note(sys._getframe(1))
        finally:
            cls._watching = watch

    def _note(self, caller: FrameType | None) -> None:
        """Count an event for the nearest plugin, if code in a plugin's folder has caused it."""
        while caller is not None and _top_module(caller) in _PASSED:
            caller = caller.f_back
        if caller is None or Path(caller.f_code.co_filename).parent not in self._folders:
            return
        while caller is not None:
            if owners := self._files.get(Path(caller.f_code.co_filename)):
                self._asking.update(owners)
                return
            caller = caller.f_back


def _top_module(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


@functools.cache
def _add_hook() -> None:
    """Add the hook of this process, once; the interpreter keeps it to its end."""
    sys.addaudithook(SimulatorWatch._take)


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
