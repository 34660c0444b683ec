"""Rules of the source that are checked on its syntax trees; unique names; limits of lines."""

import ast
import importlib
import re
import sys
from collections import defaultdict
from collections.abc import Iterator

import pytest
from architecture_sources import (
    BEHAVIORS,
    MODULES,
    ROOT,
    dotted,
    import_settings,
    imports,
    module_name,
    names,
    shown,
    stack_modules,
    tree_of,
)
from line_budget import LIMITS, counts
from processes import run

import navfw

MAX_EXPORTED = 260
MAX_LINES = 400
MAX_FUNCTION_LINES = 60
SOURCES = [*MODULES, *BEHAVIORS]
FOR_BEHAVIORS = sys.stdlib_module_names | {"numpy", "pydantic"}
DECIDING = [*stack_modules(), *BEHAVIORS]
OUTSIDE = {"datetime", "os", "random", "secrets", "socket", "time"}
TRUTH = {"true_pose", "true_depth", "scene_geometry", "SceneGeometry", "contacts"}
ENGINE = """
    getBasePositionAndOrientation getBaseVelocity getCameraImage getClosestPoints getContactPoints
    getJointState getLinkState rayTest rayTestBatch resetBasePositionAndOrientation stepSimulation
"""
ANNOTATIONS = {ast.AnnAssign, ast.FunctionDef, ast.arg}
SEEDED = {"BitGenerator", "Generator", "PCG64", "Philox", "SeedSequence", "default_rng"}


def test_the_sources_are_found() -> None:
    assert len(MODULES) > 100
    assert len(BEHAVIORS) >= 8
    assert ROOT / "navfw" / "stack" / "stack.py" in stack_modules()
    assert all(path.is_file() for path in DECIDING)


def test_behaviors_import_public_names_alone() -> None:
    for path in BEHAVIORS:
        for module, name in imports(tree_of(path)):
            if module == "navfw":
                assert name in navfw.__all__, shown(path)
            else:
                assert module.split(".")[0] in FOR_BEHAVIORS, shown(path)


def test_every_public_name_resolves_and_no_other_does() -> None:
    assert sorted(navfw.__all__) == sorted(set(navfw.__all__))
    for name in navfw.__all__:
        assert getattr(navfw, name) is not None
    with pytest.raises(AttributeError, match="Stuck"):
        _ = navfw.Stuck  # type: ignore[attr-defined]


def test_modules_are_short_and_have_docstrings() -> None:
    lines = {shown(path): len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    assert {name: count for name, count in lines.items() if count > MAX_LINES} == {}
    assert [shown(path) for path in SOURCES if not ast.get_docstring(tree_of(path))] == []


def test_functions_are_short() -> None:
    # a compiled loop reads best in one piece
    found = {
        f"{shown(path)}: {node.name}": (node.end_lineno or node.lineno) - node.lineno + 1
        for path in SOURCES
        if not path.stem.endswith("kernels")
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.FunctionDef)
    }
    assert {name: lines for name, lines in found.items() if lines > MAX_FUNCTION_LINES} == {}


def test_annotations_are_not_evaluated() -> None:
    first = ("__future__", "annotations")
    annotated = [path for path in SOURCES if ANNOTATIONS & {*map(type, ast.walk(tree_of(path)))}]
    assert len(annotated) > 100
    assert [shown(path) for path in annotated if first not in set(imports(tree_of(path)))] == []


def test_packages_alone_have_an_all_and_define_its_names() -> None:
    missing = []
    for path in MODULES:
        if path.name == "__init__.py":
            package = importlib.import_module(module_name(path))
            public = getattr(package, "__all__", ())
            missing += [f"{package.__name__}.{n}" for n in public if not hasattr(package, n)]
        else:
            assert "__all__" not in set(names(tree_of(path))), shown(path)
    assert missing == []


def test_names_that_rooms_export_are_imported_from_them() -> None:
    # so that a module can move within its room; what no other room imports, tests take from modules
    exported = {
        package.__name__: {*package.__all__}
        for path in MODULES
        if path.name == "__init__.py" and "lazy_loader" in path.read_text(encoding="utf-8")
        for package in [importlib.import_module(module_name(path))]
    }
    assert sum(map(len, exported.values())) <= MAX_EXPORTED
    leaves = [
        f"{shown(path)}: {module}: {name}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for module, name in imports(tree_of(path))
        if module.count(".") > 1 and name in exported.get(module.rpartition(".")[0], ())
        if module.split(".")[1] != path.parent.name
    ]
    assert leaves == []


def test_loops_of_links_raise_nowhere() -> None:
    found = [
        shown(path)
        for path in SOURCES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Call) and not node.args
        if isinstance(node.func, ast.Attribute) and node.func.attr == "resolve"
    ]
    assert found == [], "Path.resolve raises RuntimeError; use navfw.config.input_file.real_path"


def test_import_contracts_have_no_exceptions() -> None:
    assert import_settings()["exclude_type_checking_imports"] is False
    for contract in import_settings()["contracts"]:
        assert not {"ignore_imports", "skip_descendants"} & contract.keys(), contract["name"]


def test_only_sim_talks_to_the_physics_engine() -> None:
    users = {
        shown(path.parent)
        for path in SOURCES
        if any(module.split(".")[0] == "pybullet" for module, _ in imports(tree_of(path)))
    }
    assert users == {"navfw/sim"}
    callers = {shown(p.parent) for p in SOURCES if set(ENGINE.split()) & set(names(tree_of(p)))}
    assert callers == {"navfw/sim"}


def test_the_stack_uses_no_truth() -> None:
    used = {shown(path): TRUTH & set(names(tree_of(path))) for path in DECIDING}
    assert {name: what for name, what in used.items() if what} == {}


def test_no_decision_reads_the_clock_or_the_environment() -> None:
    # the stopwatch only measures; the watchdog ends calls that would never return,
    # which is recorded as a fault of the run
    exempt = {"stopwatch.py", "watchdog.py"}
    decided = [path for path in DECIDING if path.name not in exempt]
    used = {shown(path): OUTSIDE & {m for m, _ in imports(tree_of(path))} for path in decided}
    assert {name: what for name, what in used.items() if what} == {}


def test_all_random_numbers_come_from_a_generator_passed_in() -> None:
    drawn = []
    for path in SOURCES:
        tree = tree_of(path)
        assert "random" not in {module for module, _ in imports(tree)}
        taken = {
            f"numpy.random.{name}" for module, name in imports(tree) if module == "numpy.random"
        }
        for name in taken | {dotted(node) for node in ast.walk(tree)}:
            library, _, called = name.rpartition("random.")
            if library in {"np.", "numpy."} and called not in SEEDED:
                drawn.append(f"{shown(path)}: {name}")
    assert drawn == []


@pytest.mark.slow
def test_every_module_can_be_the_first_to_be_imported() -> None:
    broken = []
    for path in MODULES:
        name = module_name(path)
        if name.endswith("__main__"):
            continue
        done = run([sys.executable, "-W", "error", "-c", f"import {name}"])
        if done.returncode:
            broken.append(f"{name}: {done.stderr.strip().splitlines()[-1]}")
    assert broken == []


SUPERLATIVES = (
    "BIGGEST|CLOSEST|COARSEST|DEEPEST|FARTHEST|FASTEST|FEWEST|FINEST|GREATEST|HIGHEST|LARGEST|LEAST"
    "|LONGEST|LOWEST|MOST|NARROWEST|NEAREST|OLDEST|SHORTEST|SLOWEST|SMALLEST|STEEPEST|STRONGEST"
    "|THINNEST|WEAKEST|WIDEST"
)


def classes(node: ast.AST) -> Iterator[ast.ClassDef]:
    """Every class below ``node``, except a plugin's nested ``Params``."""
    for child in ast.iter_child_nodes(node):
        nested = isinstance(node, ast.ClassDef)
        if isinstance(child, ast.ClassDef) and not (nested and child.name == "Params"):
            yield child
        yield from classes(child)


def repeated(places: dict[str, list[str]]) -> dict[str, list[str]]:
    return {name: where for name, where in sorted(places.items()) if len(where) > 1}


def test_no_two_classes_have_the_same_name() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for path in [*MODULES, *BEHAVIORS]:
        for cls in classes(tree_of(path)):
            places[cls.name.lstrip("_")].append(f"{shown(path)}:{cls.lineno}")
    assert repeated(places) == {}


def test_bounds_are_named_min_and_max() -> None:
    superlative = re.compile(rf"(^|_)({SUPERLATIVES})(_|$)")
    superlatives = [
        f"{shown(path)}: {node.id}"
        for path in [*MODULES, *BEHAVIORS]
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Name) and superlative.search(node.id)
    ]
    assert superlatives == []


def test_constants_of_the_robot_say_where_their_values_come_from() -> None:
    numeric = re.compile(r"^_?[A-Z][A-Z0-9_, ]*(?:: [^=]+)? = [^\"'[]*(?<!\w)\d")
    origin = re.compile(r"  # (?:chosen|defined|derived|measured)\b")
    lines = [
        (shown(path), line)
        for path in stack_modules()
        for line in path.read_text(encoding="utf-8").splitlines()
        if numeric.match(line)
    ]
    assert len(lines) > 400
    assert [line for line in lines if not origin.search(line[1])] == []


def test_every_limit_limits_something() -> None:
    counted = counts()
    assert counted.keys() == LIMITS.keys()
    assert min(counted.values()) > 0
