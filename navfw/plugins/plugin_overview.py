"""A quick listing of plugins: the shipped ones as their source says, without importing them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from navfw.config.input_file import read_input, shown_path
from navfw.config.lookup import plugin_files, project_plugin_folders, shipped_folder
from navfw.config.project_code import require_trust
from navfw.plugins.built_in import BUILT_IN, installed_points, summary_of

_PACKAGE = Path(__file__).parents[1]
_MAX_SOURCE = 1_000_000
"""Largest size of a shipped plugin's source [byte]."""


def overview() -> list[dict[str, Any]]:
    """Every plugin as plain data: kind, name, source, summary and error, in the order of kinds.

    Of shipped plugins this is what their source says: they are neither imported nor verified, which
    ``Registry.listing`` does. Those of the project and of installed packages are.

    Raises:
        UntrustedCodeError: the project has plugins, and the user has not agreed to execute them.

    """
    require_trust()
    points, folders = installed_points(), project_plugin_folders()
    try:
        shipped = [*_outlines_of_modules(), *_outlines_of_behaviors()]
    except SyntaxError:
        from navfw.plugins.registry import default_registry

        return default_registry().listing()  # which has the error
    order = list(BUILT_IN)
    shipped.sort(key=lambda row: (order.index(row["kind"]), row["name"]))
    if not points and not folders:
        return shipped
    from navfw.plugins.registry import Registry

    registry = Registry()
    for row in shipped:
        registry.register_lazily(row["kind"], row["name"], "", row["source"])
    for folder in folders:
        registry.discover_folder(folder)
    registry.discover_entry_points(points)
    return registry.listing(outlines=shipped)


def _outlines_of_modules() -> Iterator[dict[str, Any]]:
    for kind, plugins in BUILT_IN.items():
        for name, target in plugins.items():
            module, _, class_name = target.partition(":")
            file = _PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py")
            (cls,) = (cls for cls in _classes(file) if cls.name == class_name)
            yield _outline(kind, name, "navfw", cls)


def _outlines_of_behaviors() -> Iterator[dict[str, Any]]:
    for file in plugin_files(shipped_folder() / "behaviors"):
        for cls in _classes(file):
            for node in cls.body:
                match node:
                    case ast.AnnAssign(target=ast.Name(id="name"), value=ast.Constant(str(name))):
                        is_composite = ast.unparse(cls.bases[0]).endswith("Composite")
                        kind = "composite" if is_composite else "behavior"
                        yield _outline(kind, name, shown_path(file), cls)


def _outline(kind: str, name: str, source: str, cls: ast.ClassDef) -> dict[str, Any]:
    summary = summary_of(ast.get_docstring(cls))
    return {"name": name, "kind": kind, "source": source, "summary": summary, "error": None}


def _classes(file: Path) -> list[ast.ClassDef]:
    tree = ast.parse(read_input(file, _MAX_SOURCE), str(file))
    return [node for node in tree.body if isinstance(node, ast.ClassDef)]
