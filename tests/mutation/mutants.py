"""Mutation testing of rooms, on request: do the tests notice changed code?

Cosmic Ray's operators change one place at a time (a sign, a comparison, a number, a loop); the
tests of the room must then fail. A random sample is drawn, as all mutants take days::

    uv run --group mutation python tests/mutation/mutants.py --sample 25 --workers 2 --write

``--write`` keeps the table of what was killed in ``docs/robustness.md``. Left out are mutants that
cannot change what the code does: within annotations that nothing reads, of decorators
(``numba.njit`` only compiles), and of whether compiled code is cached. Exit code 1 if fewer mutants
than ``--least`` percent are killed in a room.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).parents[2]
ROOMS = {
    "stack": ("navfw/stack/stack.py", "tests/stack tests/missions/test_missions_runner.py"),
    "safety": ("navfw/safety", "tests/safety"),
    "localmap": ("navfw/localmap", "tests/localmap"),
    "movers": ("navfw/movers", "tests/movers"),
    "papfis": ("navfw/papfis", "tests/papfis"),
    "locom": ("navfw/locom", "tests/locom"),
    "fuzzy": ("navfw/fuzzy", "tests/fuzzy"),
    "egomotion": ("navfw/egomotion", "tests/egomotion"),
    "localization": ("navfw/localization", "tests/localization"),
    "topomap": ("navfw/topomap", "tests/topomap"),
    "worldgen": ("navfw/worldgen", "tests/worldgen"),
    "perceive": ("navfw/perceive", "tests/perceive"),
}
"""Source and tests of each room."""
LEFT_OUT = ("core/RemoveDecorator", "core/VariableReplacer", "core/VariableInserter")
TIMEOUT = 600.0
"""Time [s] after which the tests of a mutant count as failed: it loops for ever."""

_WORK = """
import json, sys
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_item import MutationSpec
spec, command, timeout = json.loads(sys.stdin.read())
result = mutate_and_test([MutationSpec(**spec)], command, timeout)
print(json.dumps([str(result.worker_outcome.value), result.test_outcome and
                  str(result.test_outcome.value), result.diff]))
"""


def mutants_of(source: Path) -> Iterator[dict[str, object]]:
    """All mutants of a module, as Cosmic Ray specifies them, without those of no effect."""
    from cosmic_ray.commands.init import _all_work_items

    tree = ast.parse(source.read_text(encoding="utf-8"))
    skipped = [
        (node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0)
        for node in (*_annotations(tree), *_cache_settings(tree))
    ]
    for item in _all_work_items([source], {}):
        (spec,) = item.mutations
        start = tuple(spec.start_pos)
        inside = any((a, b) <= start < (c, d) for a, b, c, d in skipped)
        if spec.operator_name in LEFT_OUT or inside:
            continue
        yield {
            "module_path": str(source),
            "operator_name": spec.operator_name,
            "operator_args": dict(spec.operator_args),
            "occurrence": spec.occurrence,
            "start_pos": spec.start_pos,
            "end_pos": spec.end_pos,
            "definition_name": spec.definition_name,
        }


def _annotations(tree: ast.AST) -> Iterator[ast.expr]:
    """Annotations that are never evaluated, all modules postponing them.

    Those of arguments, results and local variables, and of the fields of dataclasses, which nothing
    inspects in these rooms. A pydantic model evaluates its own: those of other classes count.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            if node.returns is not None:
                yield node.returns
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            yield from (a.annotation for a in arguments if a.annotation is not None)
            yield from (n.annotation for n in ast.walk(node) if isinstance(n, ast.AnnAssign))
        elif isinstance(node, ast.ClassDef) and _is_dataclass(node):
            # ClassVar is read as text, by name: it tells fields from other variables
            yield from (
                n.annotation
                for n in node.body
                if isinstance(n, ast.AnnAssign) and "ClassVar" not in ast.unparse(n.annotation)
            )


def _is_dataclass(node: ast.ClassDef) -> bool:
    called = (d.func if isinstance(d, ast.Call) else d for d in node.decorator_list)
    return any(isinstance(name, ast.Name) and name.id == "dataclass" for name in called)


def _cache_settings(tree: ast.AST) -> Iterator[ast.expr]:
    """The values of ``cache`` in decorators: whether machine code is kept on disk."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            calls = (d for d in node.decorator_list if isinstance(d, ast.Call))
            yield from (k.value for call in calls for k in call.keywords if k.arg == "cache")


def drawn(rooms: list[str], sample: int, seed: int) -> list[tuple[str, dict[str, object]]]:
    """``sample`` mutants of each room, drawn at random."""
    chosen = []
    for room in rooms:
        path = ROOT / ROOMS[room][0]
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        every = [mutant for file in files for mutant in mutants_of(file)]
        picked = random.Random(f"{seed}-{room}").sample(every, min(sample, len(every)))  # noqa: S311
        chosen += [(room, mutant) for mutant in picked]
        print(f"{room}: {len(picked)} of {len(every)} mutants", flush=True)
    return chosen


def run(folder: Path, room: str, mutant: dict[str, object]) -> tuple[bool, str]:
    """Whether the tests in a copy of the project kill the mutant, and its diff."""
    inside = {
        **mutant,
        "module_path": str(folder / Path(str(mutant["module_path"])).relative_to(ROOT)),
    }
    tests = " ".join(_tests(folder, room, Path(str(mutant["module_path"])).stem))
    command = f"{sys.executable} -m pytest -x -q --no-cov -p no:xdist -p no:cacheprovider {tests}"
    done = subprocess.run(  # noqa: S603 - this Python, fixed arguments
        [sys.executable, "-c", _WORK],
        input=json.dumps([inside, command, TIMEOUT]),
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        check=True,
    )
    worker, outcome, diff = json.loads(done.stdout.splitlines()[-1])
    return worker != "normal" or outcome != "survived", (diff or "").replace(f"{folder}/", "")


def _tests(folder: Path, room: str, module: str) -> list[str]:
    """The files of a room's tests, those that name the mutated module first."""
    files: list[Path] = []
    for place in ROOMS[room][1].split():
        path = folder / place
        files += sorted(path.glob("test_*.py")) if path.is_dir() else [path]
    files.sort(key=lambda file: module not in file.read_text(encoding="utf-8"))
    return [str(file.relative_to(folder)) for file in files if file.exists()]


def write_table(killed: dict[str, int], tried: dict[str, int]) -> None:
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
    random.Random(options.seed).shuffle(mutants)  # noqa: S311 - no cryptography
    killed = dict.fromkeys(options.rooms, 0)
    tried = dict.fromkeys(options.rooms, 0)
    with tempfile.TemporaryDirectory() as temporary:
        copies: SimpleQueue[Path] = SimpleQueue()
        ignored = shutil.ignore_patterns(".git", ".venv", ".tools", "runs", ".*_cache", "uv.lock")
        for number in range(options.workers):
            copies.put(Path(shutil.copytree(ROOT, f"{temporary}/{number}", ignore=ignored)))

        def work(mutant: tuple[str, dict[str, object]]) -> tuple[str, bool, str]:
            folder = copies.get()
            try:
                return (mutant[0], *run(folder, *mutant))
            finally:
                copies.put(folder)

        with ThreadPoolExecutor(options.workers) as pool:
            for room, dead, diff in pool.map(work, mutants):
                tried[room] += 1
                killed[room] += dead
                if not dead:
                    print(f"--- survived in {room}\n{diff}", flush=True)
    for room in options.rooms:
        print(f"{room:10s} {killed[room]:4d} of {tried[room]:4d} killed")
    if options.write:
        write_table(killed, tried)
    weak = [room for room in options.rooms if 100.0 * killed[room] < options.least * tried[room]]
    return 1 if weak else 0


if __name__ == "__main__":
    sys.exit(main())
