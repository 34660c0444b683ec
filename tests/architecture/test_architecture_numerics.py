"""What commands depend on calls nothing whose last bits depend on the processor."""

import ast
from collections.abc import Iterator
from pathlib import Path

from architecture_sources import BEHAVIORS, ROOT, dotted, imports, shown, stack_modules, tree_of

ROOMS = ("sim", "worldgen", "topomap", "missions", "flow")
"""Rooms that commands depend on, besides the stack."""

FUNCTIONS = """
    angle arccos arccosh arcsin arcsinh arctan arctan2 arctanh argpartition cbrt convolve corrcoef
    correlate cosh cov dot exp exp2 expm1 float_power geomspace inner log log10 log1p log2 logaddexp
    logaddexp2 logspace matmul partition polyfit power sinh tan tensordot vdot
"""
"""Of numpy: by BLAS, or with loops of their own for AVX-512."""

OTHERS = {"cv2.matchTemplate", "scipy.linalg", "scipy.optimize", "scipy.special"}
REORDERING = {"reassoc", "contract", "afn", "arcp", "fast"}
"""Flags of numba's fastmath by which the compiler may change a sum."""

LENSES = "of recorded images alone: simulated cameras have no such lens"
ALLOWED = {
    ("navfw/lenses/lens_models.py", "@"): LENSES,
    ("navfw/lenses/lens_models.py", "np.arctan"): LENSES,
    ("navfw/lenses/lens_models.py", "np.arctanh"): LENSES,
    ("navfw/lenses/lens_models.py", "np.tan"): LENSES,
    ("navfw/egomotion/flow_egomotion.py", "np.linalg.eigh"): "of recorded images alone",
    ("navfw/egomotion/flow_egomotion.py", "np.linalg.eigvalsh"): "of recorded images alone",
    ("navfw/robot/urdf_measures.py", "np.linalg.eigvalsh"): "compared with bounds alone",
    ("navfw/topomap/clearance_grid.py", "@"): "of integers",
    ("navfw/sim/plan_walls.py", "np.linalg.svd"): "of imported plans and outlines of meshes",
}


def _sources() -> list[Path]:
    rooms = [path for room in ROOMS for path in sorted((ROOT / "navfw" / room).rglob("*.py"))]
    return sorted({*stack_modules(), *rooms, *BEHAVIORS})


def _by_rows(call: ast.Call) -> bool:
    """Whether a norm is taken along an axis, which numpy does by sums of its own."""
    return any(keyword.arg == "axis" for keyword in call.keywords)


def _is_stable(call: ast.Call) -> bool:
    kinds = [k.value for k in call.keywords if k.arg == "kind"]
    return any(isinstance(kind, ast.Constant) and kind.value == "stable" for kind in kinds)


def _flags(call: ast.Call) -> Iterator[str]:
    """Flags by which the compiler of a decorated function may reorder sums."""
    for keyword in call.keywords:
        if keyword.arg == "fastmath":
            try:
                flags = ast.literal_eval(keyword.value)
            except ValueError:
                flags = True
            if flags is True or (flags and REORDERING & set(flags)):
                yield "fastmath"


def dependent(tree: ast.AST, compiled: bool) -> Iterator[str]:
    """Operations in ``tree`` whose last bits, or order of equals, depend on the processor."""
    functions = {f"np.{name}" for name in FUNCTIONS.split()} | OTHERS
    norms = {id(n.func) for n in ast.walk(tree) if isinstance(n, ast.Call) and _by_rows(n)}
    for module, name in imports(tree):
        yield from {module, f"{module}.{name}"} & OTHERS
    for node in ast.walk(tree):
        if isinstance(node, ast.MatMult):
            yield "@"
        if isinstance(node, ast.Attribute):
            called = dotted(node)
            linear = called.startswith("np.linalg.") and called != "np.linalg.LinAlgError"
            if linear and not (called == "np.linalg.norm" and id(node) in norms):
                yield called
            if called in functions:
                yield called
        if isinstance(node, ast.Call):
            yield from _flags(node)
            is_sort = isinstance(node.func, ast.Attribute) and node.func.attr == "argsort"
            if is_sort and not compiled and not _is_stable(node):
                yield "argsort"  # equal keys in any order


def test_commands_depend_on_nothing_that_processors_do_in_different_ways() -> None:
    found = {
        (shown(path), what)
        for path in _sources()
        for what in dependent(tree_of(path), path.stem.endswith("kernels"))
    }
    assert found == set(ALLOWED)


def test_such_operations_are_found() -> None:
    source = """
a @ b; a @= b; np.linalg.solve(a, b); np.linalg.norm(a); np.linalg.norm(a, axis=1)
np.exp(a); np.argsort(a); a.argsort(kind="stable"); f(np.dot)
@numba.njit(fastmath=True)
def f(): ...
@numba.njit(fastmath={"nnan", "contract"})
def g(): ...
@numba.njit(fastmath={"nnan", "nsz"})
def h(): ...
"""
    found = sorted(dependent(ast.parse(source), compiled=False))
    expected = ["@", "@", "argsort", "fastmath", "fastmath", "np.dot", "np.exp"]
    assert found == [*expected, "np.linalg.norm", "np.linalg.solve"]
