"""The fingerprints of the commands of many short drives: the content of ``hashes.json``, and the
environments in which libraries choose what they would on another processor.

``uv run python tests/helpers/hash_table.py`` writes the file anew.
"""

import importlib
import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from processes import run

Settings = dict[str, str]

numpy_core: Any = importlib.import_module("numpy._core._multiarray_umath")

LEVEL_3 = """
    64bit avx avx2 bmi bmi2 cmov crc32 cx16 cx8 f16c fma fxsr lzcnt mmx movbe popcnt sahf
    sse sse2 sse3 sse4.1 sse4.2 ssse3 xsave
"""
"""Features of the level x86-64-v3, by LLVM's names."""


def threads(count: int) -> Settings:
    """Settings for ``count`` threads of each library that counts its own."""
    libraries = ("OMP", "OPENBLAS", "MKL", "NUMBA")
    return {f"{library}_NUM_THREADS": str(count) for library in libraries}


def has_avx512() -> bool:
    """Whether this processor has what numpy calls X86_V4."""
    return bool(numpy_core.__cpu_features__.get("X86_V4"))


def _beyond_avx2() -> str:
    """What numpy may use of this processor beyond AVX2, by its names."""
    detected = numpy_core.__cpu_features__
    return " ".join(
        name for name in numpy_core.__cpu_dispatch__ if detected[name] and name != "X86_V3"
    )


WITH_AVX2: Settings = {
    "NUMBA_CPU_NAME": "x86-64-v3",
    "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in LEVEL_3.split()),
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": _beyond_avx2(),
    "OPENCV_IPP": "avx2",
} | ({"OPENCV_CPU_DISABLE": "AVX512-SKX"} if has_avx512() else {})
"""A processor with AVX2 and no more: compiled kernels, BLAS, numpy, OpenCV and its IPP."""

WITH_AVX512: Settings = {"OPENBLAS_CORETYPE": "SkylakeX" if has_avx512() else "Zen"}
"""All that this processor has, with another BLAS than it would choose."""


Hashes = dict[str, str]
"""``command_hash`` by "entry, seed N"."""

FOLDER = Path(__file__).parents[1] / "missions"
SUITE, TABLE = FOLDER / "hashes.yaml", FOLDER / "hashes.json"
NAVFW = [sys.executable, "-c", "from navfw.cli import main; main()"]


def stored_hashes() -> Hashes:
    """What ``hashes.json`` has."""
    table: Hashes = json.loads(TABLE.read_text(encoding="utf-8"))
    return table


def measured_hashes(folder: Path, settings: Mapping[str, str]) -> Hashes:
    """What the suite drives now, in processes with ``settings`` in their environment."""
    words = ["suite", str(SUITE), "--seeds", "0:2", "--workers", "2", "--out", "table", "--quiet"]
    # it fails where a plugin has failed
    done = run([*NAVFW, *words, "--json"], cwd=folder, env=settings, timeout=3000, check=True)
    runs = json.loads(done.stdout)["runs"]
    return {f"{run['entry']}, seed {run['seed']}": run["command_hash"] for run in runs}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        hashes = measured_hashes(Path(name), {})
    TABLE.write_text(json.dumps(hashes, indent=2) + "\n", encoding="utf-8")
