"""Names are unique: a class name means one thing in navfw, a file name tells what is in it."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator

from architecture_sources import BEHAVIORS, MODULES, shown, tree_of

SUPERLATIVES = (
    "BIGGEST|CLOSEST|COARSEST|DEEPEST|FARTHEST|FASTEST|FEWEST|FINEST|GREATEST|HIGHEST|LARGEST|LEAST"
    "|LONGEST|LOWEST|MOST|NARROWEST|NEAREST|OLDEST|SHORTEST|SLOWEST|SMALLEST|STEEPEST|STRONGEST"
    "|THINNEST|WEAKEST|WIDEST"
)
VAGUE = "helpers kernels misc model reference scenes situations tools utils"


def classes(node: ast.AST) -> Iterator[ast.ClassDef]:
    """Every class below ``node``, except a plugin's nested ``Params``."""
    for child in ast.iter_child_nodes(node):
        nested = isinstance(node, ast.ClassDef)
        if isinstance(child, ast.ClassDef) and not (nested and child.name == "Params"):
            yield child
        yield from classes(child)


def repeated(places: dict[str, list[str]]) -> dict[str, list[str]]:
    return {name: where for name, where in sorted(places.items()) if len(where) > 1}


def test_params_is_left_out_only_where_it_is_nested() -> None:
    tree = ast.parse("class Params: ...\nclass A:\n class Params: ...\n class _B: ...")
    assert [cls.name for cls in classes(tree)] == ["Params", "A", "_B"]


def test_no_two_classes_have_the_same_name() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for path in [*MODULES, *BEHAVIORS]:
        for cls in classes(tree_of(path)):
            places[cls.name.lstrip("_")].append(f"{shown(path)}:{cls.lineno}")
    assert repeated(places) == {}


def test_no_two_modules_have_the_same_file_name() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for path in MODULES:
        if path.name != "__init__.py":
            places[path.name].append(shown(path))
    assert repeated(places) == {}


def test_no_module_has_a_name_that_tells_nothing() -> None:
    assert [shown(path) for path in MODULES if path.stem in VAGUE.split()] == []


def test_bounds_are_named_min_and_max() -> None:
    superlative = re.compile(rf"(^|_)({SUPERLATIVES})(_|$)")
    superlatives = [
        f"{shown(path)}: {node.id}"
        for path in [*MODULES, *BEHAVIORS]
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Name) and superlative.search(node.id)
    ]
    assert superlatives == []
