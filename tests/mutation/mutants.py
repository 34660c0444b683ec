"""Mutation testing of rooms, on request: do the tests notice changed code?

Cosmic Ray's operators change one place at a time (a sign, a comparison, a number, a loop); the
tests of the room must then fail. A random sample is drawn, as all mutants take days::

    uv run --group mutation python tests/mutation/mutants.py --sample 25 --workers 2 --write

``--write`` keeps the table of what was killed in ``docs/robustness.md``. Exit code 1 if fewer
mutants than ``--least`` percent are killed in a room.

Left out are changes of what has no effect when the program runs:

- annotations, except those of classes that pydantic may read: all modules postpone them;
- removed decorators (``numba.njit`` only compiles, ``cache`` only remembers; without another one,
  as ``property``, nothing works), and ``cache`` of kernels: whether machine code is kept on disk;
- ``slots`` and ``frozen`` of dataclasses: mypy refuses what they refuse;
- ``if TYPE_CHECKING``.

Drawn mutants that ``EQUIVALENT`` explains are not counted either.

The tests run in copies of the project, which load compiled kernels from numba's cache. A kernel has
what it calls, and all constants, in its machine code: with a mutant, the kernels of all modules
that import the mutated one are compiled anew. First come the test files that name what the mutated
module defines, then those that name what is built on it, each time the quickest first.
"""

import argparse
import ast
import contextlib
import difflib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).parents[2]
ROOMS = {
    "stack": ("navfw/stack/stack.py", "tests/stack tests/missions/test_missions_runner.py"),
    "safety": ("navfw/safety", "tests/safety"),
    "localmap": ("navfw/localmap", "tests/localmap tests/safety/test_safety_sight.py"),
    "movers": ("navfw/movers", "tests/movers"),
    "papfis": ("navfw/papfis", "tests/papfis"),
    "locom": ("navfw/locom", "tests/locom"),
    "fuzzy": ("navfw/fuzzy", "tests/fuzzy"),
    "egomotion": ("navfw/egomotion", "tests/egomotion"),
    "localization": ("navfw/localization", "tests/localization"),
    "topomap": ("navfw/topomap", "tests/topomap"),
    "worldgen": ("navfw/worldgen", "tests/worldgen"),
    "perceive": ("navfw/perceive", "tests/perceive tests/ros/test_ros_bags_replay.py"),
}
"""Source and tests of each room."""
LEFT_OUT = ("core/RemoveDecorator", "core/VariableReplacer", "core/VariableInserter")
SETTINGS = {"cache", "slots", "frozen"}
"""Arguments of decorators that are left out."""
EQUIVALENT = {
    "if hit_weight[i] >= 0.0:": "hits of no weight add nothing",
    "apart = np.isfinite(ground.price) * ~np.isfinite(costs)": "truth values multiply like and",
    "known = without_specks(free, occupied, _SPECK // grid.cell**2)": "cells are whole numbers",
    "self._turn = 1.0": "the first valid image sets it to 0",
    "return SafetyVerdict(Twist(v, w), reason, stopped=twist.v > 0.0 and v == 0.0)": (
        "no forward speed becomes negative"
    ),
}
"""By changed line, why a mutant has no effect: those are not counted."""
PATIENCE, PATIENCE_WITH_ALL = 10.0, 4.0
"""A test, or all of them, fail with a mutant if they take so many times as long as without."""
COMPILATION = 60.0
"""Time [s] to compile kernels on top of that."""


class Mutant(NamedTuple):
    """The change of one place in a module of the package."""

    room: str
    module: str
    operator: str
    arguments: Mapping[str, Any]
    occurrence: int

    def applied(self, code: str) -> str:
        """The changed ``code`` of the module."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        operator = get_operator(self.operator)(**self.arguments)
        return str(mutate_code(code, operator, self.occurrence))


class Durations(NamedTuple):
    """Time [s] that the tests of a room take without a mutant: by file, and the longest test."""

    files: Mapping[str, float]
    longest: float


# --- drawing --------------------------------------------------------------------------------------


def drawn(rooms: list[str], sample: int, seed: int) -> list[Mutant]:
    """``sample`` mutants of each room, drawn at random."""
    chosen: list[Mutant] = []
    for room in rooms:
        path = ROOT / ROOMS[room][0]
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        every = [mutant for file in files for mutant in mutants_of(room, file)]
        chosen += random.Random(f"{seed}-{room}").sample(every, min(sample, len(every)))  # noqa: S311
        print(f"{room}: {min(sample, len(every))} of {len(every)} mutants", flush=True)
    return chosen


def mutants_of(room: str, source: Path) -> Iterator[Mutant]:
    """All mutants of a module without those of no effect."""
    from cosmic_ray.commands.init import _all_work_items

    tree = ast.parse(source.read_text(encoding="utf-8"))
    skipped = [
        (node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0)
        for node in (*_annotations(tree), *_settings(tree))
    ]
    for item in _all_work_items([source], {}):
        (spec,) = item.mutations
        start = tuple(spec.start_pos)
        inside = any((a, b) <= start < (c, d) for a, b, c, d in skipped)
        if spec.operator_name not in LEFT_OUT and not inside:
            module = str(source.relative_to(ROOT))
            arguments = dict(spec.operator_args)
            yield Mutant(room, module, spec.operator_name, arguments, spec.occurrence)


def _annotations(tree: ast.Module) -> Iterator[ast.expr]:
    """Annotations that nothing evaluates, and the condition of imports for them."""
    yield from (node.annotation for node in tree.body if isinstance(node, ast.AnnAssign))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            if node.returns is not None:
                yield node.returns
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            yield from (a.annotation for a in arguments if a.annotation is not None)
            yield from (n.annotation for n in ast.walk(node) if isinstance(n, ast.AnnAssign))
        elif isinstance(node, ast.ClassDef) and _is_plain(node):
            # ClassVar is read as text, by name: it tells fields from other variables
            yield from (
                n.annotation
                for n in node.body
                if isinstance(n, ast.AnnAssign) and "ClassVar" not in ast.unparse(n.annotation)
            )
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            yield node.test


def _is_plain(node: ast.ClassDef) -> bool:
    """Whether a class is a dataclass, a tuple or a protocol, or has no base."""
    decorators = {ast.unparse(d).partition("(")[0] for d in node.decorator_list}
    bases = {ast.unparse(base) for base in node.bases}
    return "dataclass" in decorators or bases <= {"NamedTuple", "Protocol"}


def _settings(tree: ast.Module) -> Iterator[ast.expr]:
    """The values of ``SETTINGS`` in decorators."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            calls = (d for d in node.decorator_list if isinstance(d, ast.Call))
            yield from (k.value for call in calls for k in call.keywords if k.arg in SETTINGS)


# --- what depends on a module ---------------------------------------------------------------------


@cache
def public_names() -> dict[str, dict[str, str]]:
    """By package, the modules of the names in its stub file."""
    names: dict[str, dict[str, str]] = defaultdict(dict)
    for stub in (ROOT / "navfw").rglob("__init__.pyi"):
        folder = stub.parent.relative_to(ROOT)
        for node in ast.parse(stub.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom):
                file = folder.joinpath(*(node.module or "").split("."))
                for alias in node.names:
                    names[".".join(folder.parts)][alias.name] = _file_of(str(file))
    return names


@cache
def importers() -> dict[str, set[str]]:
    """By module, the modules that import something from it."""
    users: dict[str, set[str]] = defaultdict(set)
    for path in (ROOT / "navfw").rglob("*.py"):
        user = str(path.relative_to(ROOT))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("navfw"):
                for alias in node.names:
                    module = public_names().get(str(node.module), {}).get(alias.name)
                    users[module or _file_of(f"{node.module}.{alias.name}")].add(user)
                    users[module or _file_of(str(node.module))].add(user)
    return users


def _file_of(module: str) -> str:
    path = module.replace(".", "/")
    return f"{path}.py" if (ROOT / f"{path}.py").exists() else f"{path}/__init__.py"


def dependents(module: str) -> set[str]:
    """``module`` and all modules that import it, some of them through others."""
    reached, new = {module}, {module}
    while new:
        new = {user for one in new for user in importers()[one]} - reached
        reached |= new
    return reached


def ordered_tests(mutant: Mutant, durations: Durations) -> list[str]:
    """The test files of the mutant's room, first those that name what has been mutated."""
    modules = dependents(mutant.module)
    own, built_on_it = {Path(mutant.module).stem}, set()
    for package in public_names().values():
        own |= {name for name, module in package.items() if module == mutant.module}
        built_on_it |= {name for name, module in package.items() if module in modules}

    def rank(file: str) -> tuple[int, float]:
        words = set(re.findall(r"\w+", (ROOT / file).read_text(encoding="utf-8")))
        return 2 - bool(words & built_on_it) - bool(words & own), durations.files[file]

    return sorted(durations.files, key=rank)


# --- running --------------------------------------------------------------------------------------


def run_tests(folder: Path, tests: list[str], limits: tuple[float, float], *options: str) -> int:
    """The exit code of pytest in a copy; ``limits`` [s] are of a test, and of all together."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-cov", "-p", "no:xdist"]
    command += ["-p", "no:cacheprovider", "-o", f"faulthandler_timeout={limits[0]}"]
    command += ["-o", "faulthandler_exit_on_timeout=true", *options, *tests]
    process = subprocess.Popen(  # noqa: S603 - this Python, words of our own
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(limits[1])
    except subprocess.TimeoutExpired:
        return 1
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # with the processes that tests have started
        process.wait()


def measured(folder: Path, room: str) -> Durations:
    """The durations of a room's tests without a mutant; they all pass."""
    report = folder / "report.xml"
    if run_tests(folder, ROOMS[room][1].split(), (1800.0, 3600.0), f"--junit-xml={report}"):
        raise SystemExit(f"{room}: tests fail without a mutant:\n{report.read_text()}")
    files: dict[str, float] = defaultdict(float)
    longest = 0.0
    for test in ElementTree.parse(report).iter("testcase"):  # noqa: S314 - pytest has written it
        duration = float(test.attrib["time"])
        files[_file_of(test.attrib["classname"])] += duration
        longest = max(longest, duration)
    return Durations(files, longest)


def kills(pristine: Path, folder: Path, mutant: Mutant, durations: Durations) -> bool:
    """Whether the tests in a copy of the project kill the mutant."""
    for_one = COMPILATION + PATIENCE * durations.longest
    for_all = COMPILATION + PATIENCE_WITH_ALL * sum(durations.files.values())
    source = folder / mutant.module
    source.write_text(mutant.applied(source.read_text(encoding="utf-8")), encoding="utf-8")
    compiled = [
        file.relative_to(pristine)
        for module in map(Path, dependents(mutant.module))
        for file in (pristine / module.parent / "__pycache__").glob(f"{module.stem}.*.nb[ic]")
    ]
    for file in compiled:
        (folder / file).unlink()
    code = run_tests(folder, ordered_tests(mutant, durations), (for_one, for_all))
    for file in (Path(mutant.module), *compiled):
        shutil.copy2(pristine / file, folder / file)
    return code != 0


def changed_lines(mutant: Mutant) -> str:
    """The mutant as a diff."""
    code = (ROOT / mutant.module).read_text(encoding="utf-8")
    before, after = code.splitlines(), mutant.applied(code).splitlines()
    diff = difflib.unified_diff(before, after, mutant.module, mutant.operator, n=2, lineterm="")
    return "\n".join(diff)


def is_equivalent(mutant: Mutant) -> bool:
    """Whether ``EQUIVALENT`` says why a mutant has no effect; the reason is printed."""
    new = [line[1:].strip() for line in changed_lines(mutant).splitlines()[2:] if line[:1] == "+"]
    reason = EQUIVALENT.get(" ".join(new))
    if reason:
        print(f"{mutant.module}, {mutant.operator}: not counted, {reason}", flush=True)
    return reason is not None


def write_table(killed: Mapping[str, int], tried: Mapping[str, int]) -> None:
    """Set the rows of the rooms in the table of ``docs/robustness.md``."""
    page = ROOT / "docs" / "robustness.md"
    text = page.read_text(encoding="utf-8")
    head, rest = text.split("<!-- mutation -->\n", 1)
    table, tail = rest.split("<!-- end -->", 1)
    rows = dict(re.findall(r"^(\| `\w+`) (\|.*\|)$", table, re.MULTILINE))
    for room, count in tried.items():
        rows[f"| `{room}`"] = f"| {killed[room]} | {count} |"
    lines = ["| room | killed | mutants |", "|---|---|---|", *(f"{a} {b}" for a, b in rows.items())]
    page.write_text(
        f"{head}<!-- mutation -->\n" + "\n".join(lines) + f"\n<!-- end -->{tail}", encoding="utf-8"
    )


def main() -> int:
    """Draw, run, and report; 1 if too few mutants are killed in a room."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--sample", type=int, default=25, help="mutants of each room")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--least", type=float, default=90.0, help="percent to be killed, by room")
    parser.add_argument("--write", action="store_true", help="keep the table in the docs")
    options = parser.parse_args()
    mutants = drawn(options.rooms, options.sample, options.seed)
    mutants = [mutant for mutant in mutants if not is_equivalent(mutant)]
    killed = dict.fromkeys(options.rooms, 0)
    tried = dict.fromkeys(options.rooms, 0)
    seconds = dict.fromkeys(options.rooms, 0.0)
    with tempfile.TemporaryDirectory() as temporary:
        ignored = shutil.ignore_patterns(".git", ".venv", ".tools", "runs", ".*_cache", "uv.lock")
        pristine = Path(shutil.copytree(ROOT, f"{temporary}/pristine", ignore=ignored))
        durations = {room: measured(pristine, room) for room in options.rooms}
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(options.workers):
            copies.put(Path(shutil.copytree(pristine, f"{temporary}/{number}")))

        def work(mutant: Mutant) -> tuple[Mutant, bool, float]:
            folder, began = copies.get(), time.monotonic()
            try:
                dead = kills(pristine, folder, mutant, durations[mutant.room])
                return mutant, dead, time.monotonic() - began
            finally:
                copies.put(folder)

        with ThreadPoolExecutor(options.workers) as pool:
            for mutant, dead, took in pool.map(work, mutants):
                tried[mutant.room] += 1
                killed[mutant.room] += dead
                seconds[mutant.room] += took
                what = "killed" if dead else f"SURVIVED\n{changed_lines(mutant)}"
                print(f"{took:6.1f} s, {mutant.module}, {mutant.operator}: {what}", flush=True)
    for room, count in tried.items():
        each = seconds[room] / max(1, count)
        print(f"{room:12s} {killed[room]:4d} of {count:4d} killed, {each:5.1f} s each")
    if options.write:
        write_table(killed, tried)
    weak = [room for room in options.rooms if 100.0 * killed[room] < options.least * tried[room]]
    return 1 if weak else 0


if __name__ == "__main__":
    sys.exit(main())
