"""Finds the plugins whose source imports the simulator, whose truth no robot has.

Plugins are the user's own code: nothing prevents one from reading the true pose. What is found here
marks the result of a run as ``oracle``.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

from navfw.config.input_file import read_input, real_path, shown_path
from navfw.errors import ConfigError
from navfw.interfaces import Plugin
from navfw.plugins.verification import source_file

_SIMULATOR = ("pybullet", "pybullet_data", "pybullet_utils", "navfw.sim", "navfw.missions")
"""The modules that give access to the simulator's truth, with all their submodules."""

_OF_WORLDS = {"landmark", "event", "family"}


def plugin_files(plugins: Mapping[str, Plugin]) -> dict[str, Path]:
    """Return the source files of ``plugins`` by "KIND NAME"; those without a file are left out."""
    files = {f"{plugin.kind} {name}": source_file(type(plugin)) for name, plugin in plugins.items()}
    return {label: real_path(file) for label, file in files.items() if file is not None}


def simulator_users(plugins: Mapping[str, Plugin]) -> tuple[str, ...]:
    """Return the sorted names of those ``plugins`` that use the simulator.

    A plugin declares it (``oracle``), or its source, or a helper in its folder, imports it.
    """
    return tuple(
        sorted(
            name
            for name, plugin in plugins.items()
            if plugin.oracle or ((file := source_file(type(plugin))) and _uses(file, set()))
        )
    )


def access_notes(cls: type[Plugin]) -> list[str]:
    """Return a line ``file:line: imports MODULE`` for each simulator import by a stage plugin.

    Empty for landmark kinds, events and families, which act on the world before a run, and for
    plugins that declare ``oracle``.
    """
    file = source_file(cls)
    if file is None or cls.kind in _OF_WORLDS or getattr(cls, "oracle", False):
        return []
    return [f"{shown_path(file)}:{line}: imports {name}" for line, name in simulator_imports(file)]


def simulator_imports(file: Path) -> tuple[tuple[int, str], ...]:
    """Return line and module of each simulator import in a Python ``file``; () if unreadable."""
    return _imports_in(_nodes(file))


def _imports_in(nodes: Sequence[ast.AST]) -> tuple[tuple[int, str], ...]:
    uses = []
    for node in nodes:
        named = filter(_is_simulator, _modules(node))
        uses += [(node.lineno, name) for name in islice(named, 1)]  # type: ignore[attr-defined]
    return tuple(sorted(uses))


def _nodes(file: Path) -> list[ast.AST]:
    try:
        return list(ast.walk(ast.parse(read_input(file))))
    except (ConfigError, SyntaxError, ValueError, RecursionError):
        return []


def _modules(node: ast.AST) -> Iterator[str]:
    """Yield the modules that a statement imports, ``importlib.import_module("NAME")`` included."""
    match node:
        case ast.Import(names=names):
            yield from (name.name for name in names)
        case ast.ImportFrom(module=str(module), names=names, level=0):
            yield from (module, *(f"{module}.{name.name}" for name in names))
        case ast.Call(
            func=ast.Name(id="import_module" | "__import__") | ast.Attribute(attr="import_module"),
            args=[ast.Constant(value=str(name)), *_],
        ):
            yield name


def _is_simulator(name: str) -> bool:
    return any(name == module or name.startswith(f"{module}.") for module in _SIMULATOR)


def _uses(file: Path, seen: set[Path]) -> bool:
    """Whether ``file``, or a helper in its folder, imports the simulator."""
    if file in seen:
        return False
    seen.add(file)
    nodes = _nodes(file)
    helpers = {
        file.parent / f"{name}.py"
        for node in nodes
        if isinstance(node, ast.ImportFrom) and node.level == 1
        for name in ([node.module] if node.module else [one.name for one in node.names])
    }
    return bool(_imports_in(nodes)) or any(_uses(helper, seen) for helper in helpers)
