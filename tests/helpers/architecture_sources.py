"""The source files and their syntax trees, for tests of the architecture."""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
MODULES = sorted((ROOT / "navfw").rglob("*.py"))
BEHAVIORS = sorted((ROOT / "behaviors").glob("*.py"))


def shown(path: Path) -> str:
    """A path relative to the repository, as in the names of tests."""
    return path.relative_to(ROOT).as_posix()


def module_name(path: Path) -> str:
    """The dotted name of a module of the package."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), shown(path))


def imports(tree: ast.AST) -> Iterator[tuple[str, str | None]]:
    """All imports, inside functions as well: module, and name (None for ``import module``)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "a relative import"
            yield from ((node.module or "", alias.name) for alias in node.names)


def names(tree: ast.AST) -> Iterator[str]:
    """Every name and attribute that the code uses."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr


def dotted(node: ast.AST) -> str:
    """``np.random.seed`` for its attribute node; empty for any other node."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = dotted(node.value)
        return f"{before}.{node.attr}" if before else ""
    return ""


def import_settings() -> dict[str, Any]:
    """The settings of import-linter in ``pyproject.toml``, with its contracts."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found: dict[str, Any] = settings["tool"]["importlinter"]
    return found


def stack_modules() -> list[Path]:
    """The modules of the rooms below the simulator in the import contract on the data flow."""
    (layers,) = (c["layers"] for c in import_settings()["contracts"] if c["type"] == "layers")
    modules: list[Path] = []
    for room in re.split(r" [|:] ", " | ".join(layers[1:])):
        base = ROOT / room.replace(".", "/")
        modules += sorted(base.rglob("*.py")) if base.is_dir() else [base.with_suffix(".py")]
    return modules
