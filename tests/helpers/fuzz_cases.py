"""Fuzz cases, each repeatable from a seed and its number, and what became of many of them."""

import faulthandler
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from random import Random

import typer.testing
from fuzz_mutations import MUTATORS
from fuzz_targets import TARGETS, Target, outcome_of

MAX_TIME = 5.0
"""Largest computing time of a case [s]."""

MAX_WAIT = 30.0
"""Largest time of a case by the clock [s]; then its process is ended."""

MAX_MEMORY = 1000.0
"""Largest memory of a process while it reads a mutated input [MB]."""

_PLACED = 0.03
"""Share of the cases in which something else than a file is in the input's place."""


@dataclass(frozen=True)
class Tried:
    """What became of a case; ``defect`` is empty for one that ended as it must."""

    number: int
    kind: str
    code: int
    seconds: float
    megabytes: float
    defect: str = ""


def _giant(path: Path) -> None:
    with path.open("wb") as stream:
        stream.truncate(3_000_000_000)


PLACED: dict[str, Callable[[Path], object]] = {
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "giant": _giant,
    "nothing": lambda path: None,
    "circle": lambda path: path.symlink_to(path.name),
    "folder": Path.mkdir,
    "empty": Path.touch,
}


class Workshop:
    """A folder for each kind of input, with a valid input that the cases replace."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._folder = folder
        self._seed = seed
        self._samples: dict[str, bytes] = {}

    def sample(self, kind: str) -> tuple[Path, bytes]:
        """The folder of a kind, and the content of its valid input."""
        place = self._folder / kind
        if kind not in self._samples:
            place.mkdir(parents=True)
            TARGETS[kind].prepare(place)
            self._samples[kind] = (place / TARGETS[kind].file).read_bytes()
        return place, self._samples[kind]

    def write(self, number: int) -> tuple[str, Path]:
        """Write the input of a case; returns its kind and folder."""
        random = Random(f"{self._seed}:{number}")
        kind = random.choices(list(TARGETS), [t.weight for t in TARGETS.values()])[0]
        place, content = self.sample(kind)
        target = TARGETS[kind]
        file = place / target.file
        clear(file)
        if random.random() < _PLACED:
            random.choice([*PLACED.values()])(file)
        else:
            digits = sys.get_int_max_str_digits()
            sys.set_int_max_str_digits(0)  # to write integers that cannot be read
            file.write_bytes(random.choice(MUTATORS[target.form])(content, random))
            sys.set_int_max_str_digits(digits)
        return kind, place

    def attempt(self, number: int) -> Tried:
        """Try a case."""
        kind, place = self.write(number)
        before = _megabytes()
        faulthandler.dump_traceback_later(MAX_WAIT, exit=True)
        begun = time.process_time()
        try:
            code, message = outcome_of(TARGETS[kind], place)
            defect = _defect(TARGETS[kind], place, code, message)
        except BaseException as error:  # whatever it is, it is a defect
            frames = traceback.extract_tb(error.__traceback__)
            where = next((f for f in reversed(frames) if "/navfw/" in f.filename), frames[-1])
            place_in = f"{Path(where.filename).name}:{where.lineno}"
            code, defect = -1, f"{place_in}: {type(error).__name__}: {str(error)[:200]}"
        seconds = time.process_time() - begun
        faulthandler.cancel_dump_traceback_later()
        memory = _megabytes()
        if seconds > MAX_TIME:
            defect = defect or "took too long"
        if memory > max(before, MAX_MEMORY):
            defect = defect or "took too much memory"
        return Tried(number, kind, code, seconds, memory, defect)


def clear(path: Path) -> None:
    """Remove whatever is at ``path``."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _defect(target: Target, place: Path, code: int, message: str) -> str:
    if code not in target.allowed:
        return f"exit code {code}: {message[:200]}"
    # a stack that does not suit the robot is named by its own file, a record without readings by
    # the option that gave it
    if code == 2 and not any(part in message for part in (str(place), ".yaml: ", "navfw: --")):
        return f"the message names no file: {message[:200]}"
    return ""


def _megabytes() -> float:
    """The largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000.0


def fuzz(cases: int, seed: int = 0, workers: int = 2) -> list[Tried]:
    """The outcomes of the cases 0 to ``cases`` - 1, tried in ``workers`` processes."""
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(workers, get_context("spawn"), _open, (folder, seed)) as pool,
    ):
        return list(pool.map(_attempt, range(cases), chunksize=10))


_shop: Workshop
"""That of a process of ``fuzz``."""


def _open(folder: str, seed: int) -> None:
    """Open the workshop of this process, and read the valid inputs: imports cost no case time."""
    global _shop  # noqa: PLW0603
    typer.testing._get_command = cache(typer.testing._get_command)  # type: ignore[attr-defined]
    _shop = Workshop(Path(folder) / str(os.getpid()), seed)
    for kind, target in TARGETS.items():
        code, message = outcome_of(target, _shop.sample(kind)[0])
        assert code in target.allowed - {2}, f"the sample {kind}: {message}"


def _attempt(number: int) -> Tried:
    return _shop.attempt(number)


def table(done: Sequence[Tried]) -> str:
    """The figures, a line for each kind of input."""
    lines = [
        "| input | cases | read | refused | longest [s] | defects |",
        "|---|---|---|---|---|---|",
    ]
    for kind in [*sorted({tried.kind for tried in done}), "all"]:
        of_kind = [tried for tried in done if kind in (tried.kind, "all")]
        codes = Counter(tried.code for tried in of_kind)
        refused, defects = codes[2], sum(bool(tried.defect) for tried in of_kind)
        longest = max(tried.seconds for tried in of_kind)
        read = len(of_kind) - refused - codes[-1]
        lines.append(
            f"| {kind} | {len(of_kind)} | {read} | {refused} | {longest:.1f} | {defects} |"
        )
    peak = max(tried.megabytes for tried in done)
    lines.append(f"\nlargest memory of a process: {peak:.0f} MB (at most {MAX_MEMORY:.0f} allowed,")
    lines.append(f"and {MAX_TIME:.0f} s of computing for each case)")
    return "\n".join(lines)
